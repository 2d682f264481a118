"""unittest for tests that mostly wait for programs that they start: two tests at a time. Standard library only.

A test must not share anything with others that it changes: no class fixtures, a directory of its own.
"""

import concurrent.futures
import unittest


def tests_in(suite):
    for test in suite:
        yield from tests_in(test) if isinstance(test, unittest.TestSuite) else (test,)


class Runner(unittest.TextTestRunner):
    def run(self, test):
        tests = list(tests_in(test))

        def run_all(result):
            with concurrent.futures.ThreadPoolExecutor(2) as pool:
                for done in [pool.submit(one, result) for one in tests]:
                    done.result()

        return super().run(run_all)


def main():
    unittest.main(testRunner=Runner)
