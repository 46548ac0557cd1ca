// Loops of threads over chunks.
#pragma once

#include <functional>

#include <pliant/base/types.h>

namespace pliant {

/// visit(chunk) for chunk = 0 … chunks−1, by several threads at a time. A chunk writes to its own points only, so that
/// any thread may compute any chunk. Errors of elements are rethrown; of several errors, the error of the first chunk.
/// A single chunk is visited without OpenMP, which calls the system to gather a team, even of one thread.
void for_each_chunk(Index chunks, const std::function<void(Index)>& visit);

}  // namespace pliant
