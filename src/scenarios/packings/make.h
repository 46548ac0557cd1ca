// Makes a scenario of packings from its options and its protocol.
#pragma once

#include <fmt/format.h>

#include <pliant/run/memory.h>
#include <pliant/run/scenario.h>

namespace pliant {

template <class Parameters, template <int> class Own>
Scenario packing_scenario(const std::string& name, std::string help, std::vector<std::string> most_used) {
  Scenario s = option_scenario<Parameters>(
      name, std::move(help),
      [name](const Parameters& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint) {
        check_memory({p.particles, p.points(), p.dim}, fmt::format("-n {}", p.particles), ranks);
        if (checkpoint)
          checkpoint->integer_array("active", static_cast<std::size_t>(p.particles));
        else
          p.refuse_unread(options);
        const auto make = [&]<int D>(std::integral_constant<int, D>) -> std::unique_ptr<AnyRun> {
          return std::make_unique<Run<D>>(name, p, options, ranks, std::make_unique<Own<D>>(p, ranks),
                                          std::move(checkpoint));
        };
        return p.dim == 2 ? make(std::integral_constant<int, 2>()) : make(std::integral_constant<int, 3>());
      },
      {}, std::move(most_used));
  s.units =
      "Units: σ_avg, and the energy ε in which contact energies are given. The time of a run is the number of its "
      "packings.";
  return s;
}

}  // namespace pliant
