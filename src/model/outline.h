// The edge of an outline that carries the contact of a vertex.
#pragma once

#include <pliant/model/term.h>

namespace pliant {

/// Whether the edge with first vertex a carries the contact of vertex p, given p's foot on the edge: if the foot lies
/// inside the edge; or, at a corner that is nearest to p on both of its edges, if the edge ends at the corner.
/// Therefore every place of an outline carries a contact once.
inline bool carries_contact(const StateView<2>& s, Index p, Index a, const SegmentFoot& foot) {
  if (foot.interior()) return true;
  if (foot.t == 0) return false;
  const Index b = s.topology.next[a];
  return segment_foot(s.position(p), s.position(b), s.position(s.topology.next[b])).t == 0;
}

}  // namespace pliant
