// Reads the configuration that `pliant evaluate` computes.
#pragma once

#include <vector>

#include <pliant/catalogue/catalogue.h>
#include <pliant/geometry/walls.h>
#include <pliant/scenarios/evaluate/case_value.h>
#include <pliant/system/neighbour_drag.h>

namespace pliant {

/// A configuration of particles and what acts on them.
template <int D>
struct EvaluatedCase {
  ModelKind kind;
  ModelParameters parameters;
  NeighbourDragOptions mobility;  ///< of droplets
  Vec<D> gravity = Vec<D>::Zero();
  Walls<D> walls;
  Topology topology;
  std::vector<Real> x, v;
};

/// The model that the field names. The keys of `inputs` must belong to it; a key of another model may stand there as
/// null. Errors, here and below: InputError that names the key.
ModelKind read_model(const CaseValue& model, const CaseValue& inputs);

/// Soft particles in D dimensions.
template <int D>
EvaluatedCase<D> read_soft(const CaseValue& inputs);

/// Droplets in D dimensions.
template <int D>
EvaluatedCase<D> read_droplets(const CaseValue& inputs);

/// Polygons: counter-clockwise, simple, every edge with a length.
EvaluatedCase<2> read_polygons(const CaseValue& inputs, ModelKind kind);

}  // namespace pliant
