#include <pliant/catalogue/parameter_table.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include <pliant/base/errors.h>

namespace pliant {
namespace {

void add_new(std::vector<std::string>& all, const std::vector<std::string>& more) {
  for (const std::string& one : more)
    if (std::ranges::find(all, one) == all.end()) all.push_back(one);
}

std::string defaults_text(Real in_plane, Real in_space) {
  return in_plane == in_space ? fmt::format("{:g}", in_plane)
                              : fmt::format("{:g} in 2D, {:g} in 3D", in_plane, in_space);
}

}  // namespace

std::optional<std::string> ParameterTable::Entry::term_of(std::string_view model, int dim) const {
  const auto found =
      std::ranges::find_if(readings, [&](const Reading& r) { return r.model == model && (dim == 0 || r.dim == dim); });
  return found == readings.end() ? std::nullopt : std::optional(found->term);
}

bool ParameterTable::Entry::exists_in(int dim) const {
  return std::ranges::find(readings, dim, &Reading::dim) != readings.end();
}

std::string ParameterTable::Entry::unit_text(const UnitSystem& units, int dim) const {
  if (dim != 0) return units.text(dim == 3 && other_in_space ? other_in_space->unit : unit, dim);
  if (!exists_in(2)) return units.text(unit, 3);
  if (!exists_in(3)) return units.text(unit, 2);
  if (!other_in_space) return units.text(unit, 0);
  const std::string in_plane = unit_text(units, 2), in_space = unit_text(units, 3);
  return in_plane == in_space ? in_plane : fmt::format("2D: {}, 3D: {}", in_plane, in_space);
}

std::string ParameterTable::Entry::help_text() const {
  if (!other_in_space || other_in_space->help == help) return help;
  return fmt::format("2D: {}; 3D: {}", help, other_in_space->help);
}

std::vector<std::string> ParameterTable::Entry::choices(std::string_view model) const {
  std::vector<std::string> all;
  for (const Reading& reading : readings)
    if (model.empty() || reading.model == model) add_new(all, reading.choices);
  return all;
}

/// Adds the parameters that terms read, and returns their defaults.
class ParameterTable::Collector final : public ParameterReader {
 public:
  Collector(ParameterTable& table, std::string model, int dim) : table_(table), model_(std::move(model)), dim_(dim) {
    materials = table.surroundings_.materials;
    usual_dynamic_friction = table.surroundings_.usual_dynamic_friction;
  }

  void begin(std::string_view term) override { term_ = term; }
  Real number(const Parameter& p) override {
    add(p, Kind::number);
    return p.value;
  }
  Real automatic(const Parameter& p, Real value) override {
    add(p, Kind::automatic);
    return value;
  }
  bool flag(const Parameter& p) override {
    add(p, Kind::flag);
    return p.value != 0;
  }
  std::size_t choose(const Parameter& p, std::span<const std::string_view> names) override {
    add(p, Kind::choice, {names.begin(), names.end()});
    return 0;
  }
  bool is_set(std::string_view) const override { return false; }

 private:
  void add(const Parameter& p, Kind kind, std::vector<std::string> choices = {}) {
    Entry* entry = table_.find(p.name);
    if (entry == nullptr) {
      entry = &table_.entries_.emplace_back(Entry{std::string(p.name),
                                                  std::string(p.symbol),
                                                  std::string(p.help),
                                                  std::string(p.automatic),
                                                  std::string(p.alias),
                                                  std::string(p.printed),
                                                  p.unit,
                                                  p.min,
                                                  p.max,
                                                  p.min_open,
                                                  p.role,
                                                  kind,
                                                  {}});
      entry->number = p.value;
      entry->flag = p.value != 0;
      if (kind == Kind::choice) entry->choice = choices.front();
      if (p.role == Role::dynamic_friction && std::isfinite(usual_dynamic_friction))
        entry->automatic = fmt::format("{:g}, or {} if smaller", usual_dynamic_friction, p.automatic);
    }
    if (dim_ == 3 && entry->exists_in(2) && !entry->exists_in(3)) declare_in_space(*entry, p, kind);
    const bool by_dimension = dim_ == 3 && entry->other_in_space;
    const Kind expected = entry->other_in_space && kind == Kind::number ? Kind::automatic : kind;
    if (entry->kind != expected || (by_dimension ? entry->other_in_space->help : entry->help) != p.help ||
        (kind == Kind::number && (by_dimension ? entry->other_in_space->number : entry->number) != p.value))
      throw std::logic_error("the parameter " + entry->name + " is declared differently by two terms");
    const auto same = [&](const Reading& r) { return r.model == model_ && r.term == term_ && r.dim == dim_; };
    if (const auto found = std::ranges::find_if(entry->readings, same); found != entry->readings.end())
      add_new(found->choices, choices);
    else
      entry->readings.push_back({model_, term_, dim_, std::move(choices)});
  }

  /// The parameter of a term in 3D that terms in 2D have declared under the same name.
  static void declare_in_space(Entry& entry, const Parameter& p, Kind kind) {
    const bool same_unit =
        p.unit.force == entry.unit.force && p.unit.length == entry.unit.length && p.unit.time == entry.unit.time;
    if (kind != Kind::number || entry.kind != Kind::number ||
        (entry.help == p.help && entry.number == p.value && same_unit))
      return;
    entry.other_in_space = InSpace{std::string(p.symbol), std::string(p.help), p.unit, p.value};
    entry.kind = Kind::automatic;
    entry.automatic = defaults_text(entry.number, p.value);
  }

  ParameterTable& table_;
  std::string model_, term_;
  int dim_;
};

void ParameterTable::declare(const ModelDefinition& model, int dim) {
  const auto outlines = surroundings_.rest_outlines ? std::make_shared<const RestOutlines>() : nullptr;
  if (model.plane && dim != 3) {
    Collector all(*this, model.name, 2);
    model.plane(all, {.substrate = surroundings_.substrate, .rest_outlines = outlines});
  }
  if (model.space && dim != 2 && !surroundings_.substrate) {
    Collector all(*this, model.name, 3);
    model.space(all, {});
  }
}

ParameterTable::Entry* ParameterTable::find(std::string_view name) {
  const auto found = std::ranges::find(entries_, name, &Entry::name);
  return found == entries_.end() ? nullptr : &*found;
}

ParameterTable::Entry& ParameterTable::get(std::string_view name) {
  if (Entry* found = find(name)) return *found;
  throw std::logic_error("no model of the table has a parameter " + std::string(name));
}

const ParameterTable::Entry& ParameterTable::at(std::string_view name) const {
  return const_cast<ParameterTable*>(this)->get(name);  // NOLINT: one search for both
}

std::vector<const ParameterTable::Entry*> ParameterTable::with(Role role, std::string_view model) const {
  std::vector<const Entry*> all;
  for (const Entry& entry : entries_)
    if (entry.role == role && (model.empty() || entry.read_by(model, dimension_))) all.push_back(&entry);
  return all;
}

namespace {

void set_number(ParameterTable::Entry& entry, Real value) {
  entry.number = value;
  entry.flag = value != 0;
  if (entry.kind == ParameterTable::Kind::automatic) entry.automatic_number = value;
}

}  // namespace

void ParameterTable::set(std::string_view name, Real value) { set_number(get(name), value); }

void ParameterTable::set(Role role, Real value) {
  for (Entry& entry : entries_)
    if (entry.role == role) set_number(entry, value);
}

void ParameterTable::set(Role role, std::string_view choice) {
  for (Entry& entry : entries_)
    if (entry.role == role) entry.choice = choice;
}

void ParameterTable::set_default(Role role, Real in_plane, Real in_space) {
  for (Entry& entry : entries_) {
    if (entry.role != role) continue;
    if (entry.other_in_space) {
      entry.number = in_plane;
      entry.other_in_space->number = in_space;
      entry.automatic = defaults_text(in_plane, in_space);
    } else {
      set_number(entry, entry.exists_in(2) ? in_plane : in_space);
    }
  }
}

ParameterTable::Reader::Reader(const ParameterTable& table, std::string model, int dim, ParameterTable* resolve)
    : table_(table), model_(std::move(model)), dim_(dim), resolve_(resolve) {
  materials = table.surroundings_.materials;
  usual_dynamic_friction = table.surroundings_.usual_dynamic_friction;
}

Real ParameterTable::Reader::number(const Parameter& p) {
  const Entry& entry = table_.at(p.name);
  return entry.other_in_space ? automatic(p, entry.default_in(dim_)) : entry.value();
}

Real ParameterTable::Reader::automatic(const Parameter& p, Real value) {
  const std::optional<Real> set = table_.at(p.name).automatic_number;
  if (!set && resolve_ != nullptr) resolve_->get(p.name).automatic_number = value;
  return set.value_or(value);
}

std::string ParameterTable::Reader::spelled(std::string_view name) const { return fmt::format("-{}", name); }

bool ParameterTable::Reader::is_set(std::string_view name) const {
  return table_.at(name).automatic_number.has_value();
}

std::size_t ParameterTable::Reader::choose(const Parameter& p, std::span<const std::string_view> names) {
  const Entry& entry = table_.at(p.name);
  if (const auto found = std::ranges::find(names, entry.choice); found != names.end())
    return static_cast<std::size_t>(found - names.begin());
  std::vector<std::string> models;
  for (const bool here : {true, false})  // models of these dimensions first
    for (const Reading& reading : entry.readings)
      if ((reading.dim == dim_) == here && std::ranges::find(models, reading.model) == models.end() &&
          std::ranges::find(reading.choices, entry.choice) != reading.choices.end())
        add_new(models, {here ? reading.model : fmt::format("{} in {}D", reading.model, reading.dim)});
  throw InputError("-{} {} with -model {}: only -model {} has it; use that, or {}", entry.name, entry.choice, model_,
                   alternatives(models), names.front());
}

}  // namespace pliant
