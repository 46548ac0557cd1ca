// Reads the configuration that `pliant evaluate` computes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <pliant/catalogue/catalogue.h>
#include <pliant/catalogue/parameter_values.h>
#include <pliant/geometry/walls.h>
#include <pliant/model/surface.h>
#include <pliant/scenarios/evaluate/case_value.h>
#include <pliant/system/neighbour_drag.h>

namespace pliant {

/// A configuration of particles, and their model.
template <int D>
struct EvaluatedCase {
  ModelKind kind;
  ParameterValues parameters;
  NeighbourDragOptions mobility;  ///< drag of droplets
  Vec<D> gravity = Vec<D>::Zero();
  Walls<D> walls;
  Topology topology;
  bool shape_terms = true;  ///< surfaces have energies of their shape
  std::vector<Real> x, v;
};

/// The model of a case and the values of its parameters.
struct CaseModel {
  ModelKind kind;
  ParameterValues parameters;
  bool surfaces = false;    ///< particles are closed surfaces in space
  std::string remark = {};  ///< older names that the case has
};

/// The model that the field `model` names, and the parameters among `inputs`. Older names of models have the rules that
/// [H] prints as defaults; the remark has them and older names of keys. The keys of `inputs` must belong to the model;
/// a key of another model is allowed if its value is null. Errors, here and below: InputError that names the key.
CaseModel read_model(const CaseValue& model, const CaseValue& inputs);

/// Soft particles in D dimensions.
template <int D>
EvaluatedCase<D> read_soft(const CaseValue& inputs, const ParameterValues& parameters);

/// Droplets in D dimensions.
template <int D>
EvaluatedCase<D> read_droplets(const CaseValue& inputs, const ParameterValues& parameters);

/// Polygons: counter-clockwise, simple, every edge with a length.
EvaluatedCase<2> read_polygons(const CaseValue& inputs, const CaseModel& model);

/// Closed surfaces in space.
EvaluatedCase<3> read_surfaces(const CaseValue& inputs, const CaseModel& model);

}  // namespace pliant
