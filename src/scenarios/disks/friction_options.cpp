#include <pliant/scenarios/disks/friction_options.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <pliant/base/errors.h>

namespace pliant {

void FrictionOptions::bind(Options& options, const std::string& name, const std::string& help,
                           const std::string& where) {
  options.bind(name, at_rest, {.help = where + help, .min = 0, .max = 10, .on_restart = OnRestart::fixed});
  bind_sliding(options, name, where);
}

void FrictionOptions::bind_sliding(Options& options, const std::string& name, const std::string& where,
                                   const std::string& else_) {
  const std::string automatic = std::isinf(usual_sliding)
                                    ? "the static one"
                                    : fmt::format("{:g}, or the static one if that is less", usual_sliding);
  options.bind(name + "_dynamic", sliding,
               {.help = where + "friction where they slide",
                .min = 0,
                .max = 10,
                .automatic = automatic + else_,
                .on_restart = OnRestart::fixed});
}

void FrictionOptions::resolve(const std::string& name) {
  if (!sliding) sliding = std::min(at_rest, usual_sliding);
  if (*sliding > at_rest)
    throw InputError("-{0}_dynamic {1:g} is more than -{0} {2:g}; lower it", name, *sliding, at_rest);
  if (*sliding == 0 && at_rest > 0)
    throw InputError(
        "-{0}_dynamic 0 with -{0} {1:g}: nothing would hold what has begun to slide; raise it, or give -{0} 0", name,
        at_rest);
}

}  // namespace pliant
