// A callable that lives elsewhere, for the time of a call.
#pragma once

namespace halfshade {

template <class Signature>
class FunctionRef;

/// Refers to the callable that it was made of, which must outlive it: for parameters.
template <class... Arguments>
class FunctionRef<void(Arguments...)> {
 public:
  template <class Callable>
  FunctionRef(const Callable& callable)  // implicit, so that lambdas can be passed
      : call_([](const void* context, Arguments... arguments) {
          (*static_cast<const Callable*>(context))(arguments...);
        }),
        context_(&callable) {}

  void operator()(Arguments... arguments) const { call_(context_, arguments...); }

 private:
  void (*call_)(const void* context, Arguments...);
  const void* context_;
};

}  // namespace halfshade
