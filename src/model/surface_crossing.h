// Detects closed surfaces that pierce each other or themselves, and shapes without meaning: error states of deformable
// particles in space.
#pragma once

#include <optional>

#include <pliant/model/surface.h>
#include <pliant/model/term.h>

namespace pliant {

/// An edge that pierces a face: of another particle, or of the same one.
struct Piercing {
  Index particle;
  Index a, b;  ///< vertices of the edge, numbers in the particle
  Index other;
  Index face;  ///< number in `other`
};

/// A particle that is inside another one, although they do not pierce each other.
struct Enclosure {
  Index inner, outer;
};

/// A particle whose shape energy has no meaning.
struct BadShape {
  enum class Kind {
    inverted,  ///< its volume is not positive
    flat_face  ///< a face has lost its area
  };
  Index particle;
  Kind kind;
  Index face;  ///< of flat_face: number in the particle
};

/// Result of a check of all surfaces.
struct SurfacesLook {
  std::optional<Piercing> piercing;    ///< of two particles; the first one found
  std::optional<Enclosure> enclosure;  ///< the first one found; nothing where particles pierce each other
  std::optional<BadShape> bad_shape;
  /// An own particle that crosses itself: an edge pierces a face without a common vertex, or (then `self_piercing` is
  /// empty) two neighbouring faces fold over, n̂·n̂' < −1/2.
  std::optional<Index> crossing_itself;
  std::optional<Piercing> self_piercing;
  Index self_crossings = 0;  ///< own particles that cross themselves
};

/// Below this part of its rest area a face has no direction to rely on.
inline constexpr Real least_face_area = 1e-6;

/// Whether the segment from p to q crosses the inside of the triangle a, b, c.
bool pierces(const Vec<3>& p, const Vec<3>& q, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c);

/// Compares all edges with all faces of particles that are near each other, ghosts included, so that each piercing of
/// two surfaces is found wherever the vertices are, and finds particles inside others. Costs about as much as a few
/// force evaluations.
SurfacesLook look_at_surfaces(const StateView<3>& s);

/// Errors: InputError for a surface that crosses itself in the shape of its mesh, so that it cannot be a particle.
void check_crosses_nothing(const Surface& surface);

}  // namespace pliant
