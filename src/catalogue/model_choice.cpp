#include <pliant/catalogue/model_choice.h>

#include <algorithm>

#include <fmt/format.h>

#include <pliant/base/errors.h>
#include <pliant/model/surface_terms.h>

namespace pliant {

ModelChoice::ModelChoice(std::vector<ModelDefinition> models, ModelSurroundings surroundings)
    : name(models.front().name), models_(std::move(models)), table_(std::move(surroundings)) {
  for (const ModelDefinition& model : models_) table_.declare(model);
}

bool ModelChoice::kept(const ParameterTable::Entry& entry) const {
  if (entry.role != Role::none && std::ranges::find(kept_, entry.role) != kept_.end()) return true;
  return std::ranges::all_of(entry.readings, [&](const ParameterTable::Reading& reading) {
    return std::ranges::find(left_out_, reading.term) != left_out_.end();
  });
}

void ModelChoice::make_automatic(Role role, const std::string& text) {
  for (ParameterTable::Entry& entry : table_.entries())
    if (entry.role == role) {
      entry.kind = ParameterTable::Kind::automatic;
      entry.automatic = text;
    }
}

namespace {

std::vector<OptionCure> cures_of(Role role) {
  switch (role) {
    case Role::contact_energy:
      return {Cure::stiffer_contacts};
    case Role::wall_energy:
      return {Cure::stiffer_walls};
    case Role::contact_law:
      return {{Cure::contact_barrier, "barrier"}};
    case Role::edge_contacts:
      return {Cure::edge_contacts};
    case Role::drag:
      return {Cure::drag};
    case Role::attraction:
      return {Cure::weaker_attraction};
    default:
      return {};
  }
}

}  // namespace

void ModelChoice::bind(Options& options, const UnitSystem& units, bool any_dimension) {
  const std::string group = "Model";
  options.group(group);
  if (models_.size() > 1) {
    std::string help;
    std::vector<std::string> names;
    for (const ModelDefinition& model : models_) {
      help += fmt::format("{}{}: {}", help.empty() ? "" : "; ", model.name, model.help);
      names.push_back(model.name);
    }
    options.bind("model", name, {.help = help, .choices = names, .on_restart = OnRestart::fixed});
  }
  const auto bind_all = [&](const std::optional<std::string>& model) {
    for (ParameterTable::Entry& entry : table_.entries())
      if (!kept(entry) && owner(entry) == model) bind(options, entry, units, any_dimension);
  };
  bind_all(std::nullopt);
  for (const ModelDefinition& model : models_)
    if (!in_catalogue(model)) {
      options.group(group + " " + model.name);
      bind_all(model.name);
    }
  options.group(group);
}

std::optional<std::string> ModelChoice::owner(const ParameterTable::Entry& entry) const {
  for (const ModelDefinition& model : models_)
    if (entry.read_by(model.name)) return in_catalogue(model) ? std::nullopt : std::optional(model.name);
  return std::nullopt;
}

void ModelChoice::bind(Options& options, ParameterTable::Entry& entry, const UnitSystem& units, bool any_dimension) {
  const std::vector<std::string> names = readers(entry);
  OptionSpec spec{.help = entry.help_text(),
                  .unit = entry.unit_text(units),
                  .symbol = entry.symbol,
                  .models = names,
                  .only_with = condition(entry, any_dimension),
                  .term = [this, &entry] { return entry.term_of(name, table_.dimension()); },
                  .cures = cures_of(entry.role),
                  .on_restart = OnRestart::fixed};
  if (entry.other_in_space) {
    spec.unit_of_run = [this, &entry, units] { return entry.unit_text(units, std::max(table_.dimension(), 2)); };
    spec.default_of_run = [this, &entry] { return entry.default_in(table_.dimension()); };
  }
  switch (entry.kind) {
    case ParameterTable::Kind::number:
    case ParameterTable::Kind::automatic:
      spec.min = entry.min, spec.max = entry.max, spec.min_open = entry.min_open;
      spec.automatic = entry.automatic;
      if (entry.kind == ParameterTable::Kind::number)
        options.bind(entry.name, entry.number, std::move(spec));
      else
        options.bind(entry.name, entry.automatic_number, std::move(spec));
      break;
    case ParameterTable::Kind::flag:
      options.bind(entry.name, entry.flag, std::move(spec));
      break;
    case ParameterTable::Kind::choice:
      spec.choices = entry.choices();
      options.bind(entry.name, entry.choice, std::move(spec));
      break;
  }
}

std::vector<std::string> ModelChoice::readers(const ParameterTable::Entry& entry) const {
  std::vector<std::string> names;
  for (const ModelDefinition& model : models_)
    if (entry.read_by(model.name)) names.push_back(model.name);
  return names;
}

/// The models and, if the scenario exists in 2D and 3D, the dimensions that read it; empty if all do.
std::string ModelChoice::condition(const ParameterTable::Entry& entry, bool any_dimension) const {
  const std::vector<std::string> names = readers(entry);
  std::string text = names.size() < models_.size() ? fmt::format("-model {}", alternatives(names)) : "";
  if (any_dimension && entry.exists_in(2) != entry.exists_in(3))
    text += fmt::format("{}{}D", text.empty() ? "" : ", ", entry.exists_in(2) ? 2 : 3);
  return text;
}

void ModelChoice::refuse_unread(const Options& options, std::string_view but) const {
  for (const ParameterTable::Entry& entry : table_.entries()) {
    const int dim = table_.dimension();
    if (kept(entry) || entry.read_by(name, dim) || !options.given(entry.name)) continue;
    if (entry.read_by(name))
      throw InputError("-{} ({}) with -model {} in {}D, which does not read it; leave it out, or use {}", entry.name,
                       options.source(entry.name), name, dim,
                       cures({dim == 2 ? Cure::three_dimensions : Cure::two_dimensions}));
    if (!but.empty() && std::ranges::find(entry.readings, but, &ParameterTable::Reading::term) != entry.readings.end())
      continue;
    throw InputError("-{} ({}) with -model {}, which does not read it; leave it out, or use -model {}", entry.name,
                     options.source(entry.name), name, alternatives(readers(entry)));
  }
}

const ModelDefinition& ModelChoice::model() const { return *std::ranges::find(models_, name, &ModelDefinition::name); }

bool ModelChoice::deformable() const {
  return particles() == ModelKind::rough || particles() == ModelKind::smooth || particles() == ModelKind::shape;
}

void ModelChoice::check_surfaces() const {
  if (in_catalogue(model()) && model().space && deformable())
    check_tension(term(SurfaceTension{}), term(FaceArea{}), term(EdgeLength{}));
}

Real ModelChoice::value(Role role) const {
  const auto all = parameters(role);
  return all.empty() ? 0 : all[0]->value();
}

std::string ModelChoice::choice(Role role) const {
  const auto all = parameters(role);
  return all.empty() ? "" : all[0]->choice;
}

std::string ModelChoice::options(std::initializer_list<Role> roles) const {
  std::vector<std::string> names;
  for (const Role role : roles)
    for (const ParameterTable::Entry* entry : parameters(role)) names.push_back(fmt::format("-{}", entry->name));
  return alternatives(names);
}

bool ModelChoice::is_set(Role role) const {
  return std::ranges::any_of(table_.with(role), [](const auto* entry) {
    return entry->kind != ParameterTable::Kind::automatic || entry->automatic_number.has_value();
  });
}

}  // namespace pliant
