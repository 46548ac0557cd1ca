#include <catch2/catch.hpp>

#include <array>

#include <pliant/analysis/graph.h>

namespace pliant::test::graph_test {

TEST_CASE("distances along links") {
  // A ring of five, a tail at 2, and two isolated nodes.
  const std::vector<std::array<Index, 2>> links{{0, 1}, {1, 2}, {3, 2}, {3, 4}, {0, 4}, {5, 2}, {6, 7}};
  const Graph graph = make_graph(8, links);
  CHECK(graph[2] == std::vector<Index>{1, 3, 5});
  CHECK(links_from({0}, graph) == std::vector<Index>{0, 1, 2, 2, 1, 3, -1, -1});
  CHECK(links_from({0, 5, 7, 0}, graph) == std::vector<Index>{0, 1, 1, 2, 1, 0, 1, 0});
  CHECK(links_from({}, graph) == std::vector<Index>(8, -1));
  CHECK(links_from({}, {}).empty());
}

}  // namespace pliant::test::graph_test
