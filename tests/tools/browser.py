"""Acts on an HTML report in a headless browser, where there is one. Standard library only."""

import base64
import json
import os
import re
import shutil
import subprocess
import tempfile


def program():
    return shutil.which("chromium") or shutil.which("chromium-browser")


def require(test):
    """Skips the test where there is no browser. Continuous integration (CI is set) installs one: there it fails."""
    if program() is not None:
        return
    if os.environ.get("CI"):
        test.fail("no chromium on PATH, which .ci/run installs")
    test.skipTest("no chromium on PATH")


def png_of(uri):
    return base64.b64decode(uri.removeprefix("data:image/png;base64,"))


def look(page, actions):
    """Runs `actions` (JavaScript that fills the object `seen`; may await) on a copy of the loaded page and returns
    what was seen; seen["errors"] has the page's errors. Fails when the script does not finish or the console has
    anything to say."""
    script = ('<script>const seen = {errors: []};\n'
              'addEventListener("error", event => seen.errors.push(String(event.message)));\n'
              '(async () => {\n' + actions + '\ndocument.body.dataset.seen = JSON.stringify(seen);\n'
              '})().catch(e => { document.body.dataset.seen = JSON.stringify({errors: [String(e)]}); });\n</script>')
    acted = page.with_name("acted-" + page.name)
    acted.write_text(page.read_text(encoding="utf-8").replace("</body>", script + "</body>"), encoding="utf-8")
    match = None
    for budget in (30000, 120000, 600000):  # virtual milliseconds, which on a busy machine pass before pictures are decoded
        with tempfile.TemporaryDirectory(prefix="halfshade-browser-", ignore_cleanup_errors=True) as profile:
            result = subprocess.run(
                [program(), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}",
                 "--enable-logging=stderr", f"--virtual-time-budget={budget}", "--dump-dom", acted.as_uri()],
                capture_output=True, text=True, timeout=300, check=False)
        console = [line for line in result.stderr.splitlines() if "CONSOLE" in line]
        if console:
            raise AssertionError("the console says: " + "\n".join(console))
        match = re.search(r'data-seen="([^"]*)"', result.stdout)
        if match is not None:
            break
    if match is None:
        raise AssertionError("the page's script did not finish")
    return json.loads(match.group(1).replace("&quot;", '"').replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))
