// Makes a scenario of packings from its options and its protocol.
#pragma once

#include <fmt/format.h>

#include <pliant/run/memory.h>
#include <pliant/run/run.h>
#include <pliant/run/scenario.h>

namespace pliant {

/// make(p, ranks, std::integral_constant<int, D>()) returns the protocol of a run.
template <class Parameters, class Make>
Scenario packing_scenario(const std::string& name, std::string help, std::vector<std::string> most_used,
                          const std::string& time, Make make) {
  Scenario s = option_scenario<Parameters>(
      name, std::move(help),
      [name, make](const Parameters& p, const Options& options, const Ranks& ranks,
                   std::optional<Checkpoint> checkpoint) {
        check_memory({p.particles, p.points(), p.dim}, fmt::format("-n {}", p.particles), ranks);
        if (checkpoint)
          checkpoint->integer_array("active", static_cast<std::size_t>(p.particles));
        else
          p.refuse_unread(options);
        const auto make_run = [&]<int D>(std::integral_constant<int, D> dim) -> std::unique_ptr<AnyRun> {
          return std::make_unique<Run<D>>(name, p, options, ranks, make(p, ranks, dim), std::move(checkpoint));
        };
        return p.dim == 2 ? make_run(std::integral_constant<int, 2>()) : make_run(std::integral_constant<int, 3>());
      },
      {}, std::move(most_used));
  s.units = "Units: σ_avg, and the energy ε in which contact energies are given. " + time;
  return s;
}

}  // namespace pliant
