// Undirected graph: neighbours of a node, and distances between nodes along the links.
#pragma once

#include <vector>

#include <pliant/base/types.h>

namespace pliant {

/// Of each, those that it is linked to.
using Graph = std::vector<std::vector<Index>>;

/// links: pairs of numbers below n.
template <class Links>
Graph make_graph(Index n, const Links& links) {
  Graph graph(n);
  for (const auto& [i, j] : links) {
    graph[i].push_back(j);
    graph[j].push_back(i);
  }
  return graph;
}

/// Of each, the number of links to the nearest one in `from`; −1 where no chain of links leads there. Breadth first.
inline std::vector<Index> links_from(std::vector<Index> from, const Graph& graph) {
  std::vector<Index> distance(graph.size(), -1);
  for (const Index i : from) distance[i] = 0;
  for (std::size_t k = 0; k < from.size(); ++k)
    for (const Index j : graph[from[k]])
      if (distance[j] < 0) {
        distance[j] = distance[from[k]] + 1;
        from.push_back(j);
      }
  return distance;
}

}  // namespace pliant
