#include <pliant/python/settings.h>

#include <pliant/catalogue/catalogue.h>

namespace pliant::python {
namespace {

std::vector<ModelDefinition> models_with_inertia() {
  std::vector<ModelDefinition> models;
  for (const ModelKind kind : {ModelKind::sp, ModelKind::rough, ModelKind::smooth, ModelKind::disk, ModelKind::shape})
    models.push_back(catalogue_model(kind));
  return models;
}

}  // namespace

Settings::Settings() : model(models_with_inertia()) { bind(); }

Settings::Settings(const std::vector<std::string>& arguments) : Settings() {
  arguments_ = arguments;
  options.parse(arguments);
  model.refuse_unread(options);
}

void Settings::bind() {
  model.bind(options, UnitSystem::gravitational());
  options.group("Integration");
  options.bind("integrator", method, {{"verlet", Method::verlet}, {"ts", Method::ts}},
               {.help = "velocity Verlet with a fixed step, or a method of PETSc TS",
                .cures = {{Cure::verlet, "verlet"}, {Cure::ts, "ts"}}});
  options.bind("implicit", implicit, {{"all", TermGroup::all}, {"shape", TermGroup::shape}},
               {.help = "forces that the integrator treats implicitly: all, or shape energies alone",
                .cures = {{Cure::split_forces, "shape"}, {Cure::whole_forces, "all"}}});
  options.bind("jacobian", jacobian,
               {{"assembled", JacobianKind::assembled}, {"matrix_free", JacobianKind::matrix_free}},
               {.help = "Jacobian of an implicit method: sparse matrix, or matrix-free products"});
  options.bind("dt", dt,
               {.help = "step of velocity Verlet, first step of an adaptive method",
                .unit = "t0",
                .min = 0,
                .min_open = true,
                .cures = {Cure::shorter_step},
                .automatic = "part of the limit of stability"});
  options.bind("allow_unstable_dt", allow_unstable_dt, {.help = "allow a fixed step above the limit of stability"});
  options.bind("skin", skin,
               {.help = "skin of the neighbour lists",
                .unit = "sigma_avg",
                .min = 0,
                .min_open = true,
                .automatic = "part of the mean diameter, then tuned"});
  options.bind("threads", threads, {.help = "threads; results do not depend on their number", .min = 1, .max = 1024});
}

}  // namespace pliant::python
