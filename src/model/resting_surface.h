// A closed surface alone and at rest, to find properties of its shape.
#pragma once

#include <memory>
#include <vector>

#include <pliant/model/surface_measures.h>
#include <pliant/model/term.h>

namespace pliant {

/// One particle in the shape of the mesh, in proportion so that its edges have their rest lengths. The mass of each
/// vertex is 1.
class RestingSurface {
 public:
  explicit RestingSurface(const Surface& surface) {
    const auto surfaces = std::make_shared<Surfaces>();
    surfaces->kinds.push_back(surface);
    topology_.dim = 3;
    surfaces->add_particle(topology_, 0, surface.volume, 1, static_cast<Real>(surface.points()));
    topology_.surfaces = surfaces;
    const Real factor = stretch(surface);
    for (const Vec<3>& r : surface.vertices)
      for (int k = 0; k < 3; ++k) x_.push_back(factor * r[k]);
  }

  StateView<3> view() const { return {x_.data(), nullptr, topology_, lists_, walls_}; }

 private:
  Topology topology_;
  Neighbours<3> lists_{NeighbourNeeds{}, 0};
  Walls<3> walls_;
  std::vector<Real> x_;
};

}  // namespace pliant
