// Shared by the tests of files: folders that vanish, processes that die, and small runs to write.
#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include <pliant/io/run_writer.h>

namespace pliant::test {

/// An empty folder for one test.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "pliant-io-XXXXXX").string();
    REQUIRE(::mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

inline std::string contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Runs body in a child process, which ends without unwinding (MPI belongs to the parent); returns the status of
/// waitpid. The child's exit code is the result of body, or 99 for an exception.
inline int in_child(const std::function<int()>& body) {
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    int code = 99;
    try {
      code = body();
    } catch (...) {
    }
    ::_exit(code);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  return status;
}

/// Text of the exception that body throws; "" if none.
template <class Exception, class Body>
std::string message_of(Body&& body) {
  try {
    body();
  } catch (const Exception& error) {
    return error.what();
  }
  return "";
}

inline Topology small_topology(bool polygons, int dim = 2) {
  Topology topology;
  topology.dim = dim;
  for (int m = 0; m < 4; ++m) {
    if (polygons)
      topology.add_polygon(3 + m, 1.0 + m, 0.3, 0.1, 2.0);
    else
      topology.add_soft(1.0 + 0.1 * m, 1.0);
  }
  return topology;
}

inline Manifest small_manifest() {
  Manifest manifest;
  manifest.version = "0.1.0";
  manifest.scenario = "hopper";
  manifest.model = "sp";
  manifest.seed = 7;
  manifest.options["hopper_width"] = {{"value", 5.0}, {"unit", "sigma_avg"}, {"source", "default"}};
  return manifest;
}

inline RunGeometry small_geometry() {
  return {.kind = "hopper2d", .segments = {0, 0, 1, 1, 2, 0, 3, 1}, .attributes = {{"W", 20}, {"w", 5}, {"angle", 60}}};
}

/// The numbers of frame k, all different.
struct FrameData {
  FrameData(const Topology& topology, int k, std::size_t contacts) : offset(topology.offset), k_(k) {
    const auto points = static_cast<std::size_t>(topology.points()), n = static_cast<std::size_t>(topology.particles());
    const auto dim = static_cast<std::size_t>(topology.dim);
    fill(positions, points * dim, 0);
    fill(velocities, points * dim, 1);
    if (topology.deformable())
      fill(centres, n * dim, 2);
    else
      centres = positions;
    if (topology.deformable()) fill(area, n, 3), fill(perimeter, n, 4);
    fill(wall_force, 2 * dim, 5);
    active.assign(n, 1);
    contact_count.assign(n, k);
    reinsertions.assign(n, k + 1);
    for (std::size_t c = 0; c < contacts; ++c) {
      particles.insert(particles.end(), {static_cast<Index>(c % n), static_cast<Index>((c + 1) % n)});
      at_walls.insert(at_walls.end(), {static_cast<Index>(c % n), static_cast<Index>(c % 2)});
    }
    fill(position, contacts * dim, 6);
    fill(normal, contacts * dim, 7);
    fill(overlap, contacts, 8);
    fill(force, contacts * dim, 9);
  }
  Frame frame() const {
    return {.time = 0.1 * k_,
            .step = 10 * k_,
            .offset = offset,
            .positions = positions,
            .velocities = velocities,
            .centres = centres,
            .active = active,
            .contact_count = contact_count,
            .reinsertions = reinsertions,
            .area = area,
            .perimeter = perimeter,
            .wall_force = wall_force,
            .contacts = contacts(particles),
            .wall_contacts = contacts(at_walls)};
  }

  std::vector<Index> offset;
  std::vector<Real> positions, velocities, centres, area, perimeter, wall_force;
  std::vector<std::uint8_t> active;
  std::vector<Index> contact_count, reinsertions;
  std::vector<Index> particles, at_walls;  ///< of contacts, and of the arrays below
  std::vector<Real> position, normal, overlap, force;

 private:
  void fill(std::vector<Real>& values, std::size_t count, int kind) const {
    for (std::size_t i = 0; i < count; ++i) values.push_back(k_ + 0.1 * kind + 0.001 * static_cast<Real>(i) + 1e-6);
  }
  FrameContacts contacts(const std::vector<Index>& partners) const {
    return {.count = overlap.size(),
            .particles = rows(partners),
            .position = rows(position),
            .normal = rows(normal),
            .overlap = rows(overlap),
            .force = rows(force)};
  }
  /// One row per contact.
  template <class T>
  Strided<T> rows(const std::vector<T>& values) const {
    return {values.data(), overlap.empty() ? 0 : values.size() / overlap.size() * sizeof(T)};
  }
  int k_;
};

}  // namespace pliant::test
