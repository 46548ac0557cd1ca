// Columns of a run for heat.
#pragma once

#include <fmt/format.h>

#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/io/run_writer.h>
#include <pliant/model/contact_history.h>

namespace pliant {

/// Appends the heat since the start by each cause that a term with history names, "TERM_CAUSE". Returns the sum.
/// Collective.
inline Real add_heat(std::vector<SeriesValue>& row, const ContactHistory& history, const Ranks& ranks) {
  Real all = 0;
  for (const ContactTable& table : history.tables()) {
    std::vector<Real> heat(table.heat().begin(), table.heat().end());
    ranks.sum(heat);
    for (std::size_t k = 0; k < heat.size(); ++k) {
      row.emplace_back(fmt::format("{}_{}", table.needs().name, table.needs().losses[k]), heat[k]);
      all += heat[k];
    }
  }
  return all;
}

}  // namespace pliant
