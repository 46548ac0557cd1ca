// Frames that several ranks write into one file. Run on one rank with all tests of the folder, on several by those with
// the tag.
#include <petscsys.h>
#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <optional>

#include <pliant/base/errors.h>
#include <pliant/io/run_writer.h>
#include <pliant/io/shared_file.h>

#include "io/io_support.h"

namespace pliant::test::ranks_test {
using Catch::Matchers::Contains;

namespace {

/// An empty folder shared by all ranks.
class CommonFolder {
 public:
  explicit CommonFolder(const Ranks& ranks) : ranks_(ranks) {
    if (ranks.root()) own_.emplace();
    std::vector<char> name;
    if (ranks.root()) name.assign(own_->path().native().begin(), own_->path().native().end());
    ranks.broadcast(name);
    path_ = std::string(name.begin(), name.end());
  }
  ~CommonFolder() { ranks_.any(false); }  // waits until no rank uses the folder
  const std::filesystem::path& path() const { return path_; }

 private:
  const Ranks& ranks_;
  std::optional<ScratchFolder> own_;
  std::filesystem::path path_;
};

/// The share of a frame of particles `first` to `last`, and of contacts in the same proportion.
struct Share {
  Share(const FrameData& whole, int dim, Index first, Index last) : frame(whole.frame()) {
    const std::span offsets = frame.offset;
    const auto n = static_cast<std::size_t>(last - first), d = static_cast<std::size_t>(dim), all = offsets.size() - 1;
    const auto from = static_cast<std::size_t>(first), point = static_cast<std::size_t>(offsets[from]),
               points = static_cast<std::size_t>(offsets[from + n]) - point;
    for (std::size_t k = 0; k <= n; ++k) offset.push_back(offsets[from + k] - offsets[from]);
    frame.offset = offset;
    for (auto* values : {&frame.positions, &frame.velocities}) *values = values->subspan(point * d, points * d);
    frame.centres = frame.centres.subspan(from * d, n * d);
    frame.active = frame.active.subspan(from, n);
    for (auto* values : {&frame.contact_count, &frame.reinsertions}) *values = values->subspan(from, n);
    for (auto* values : {&frame.area, &frame.perimeter})
      if (!values->empty()) *values = values->subspan(from, n);
    for (FrameContacts* c : {&frame.contacts, &frame.wall_contacts}) {
      const std::size_t skip = c->count * from / all;
      c->count = c->count * (from + n) / all - skip;
      c->particles.data = c->particles[skip];
      for (auto* values : {&c->position, &c->normal, &c->overlap, &c->force}) values->data = (*values)[skip];
    }
  }
  Frame frame;
  std::vector<Index> offset;
};

}  // namespace

TEST_CASE("ranks write their shares of a frame into one file, as one rank the whole", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const bool polygons = GENERATE(true, false);
  const int dim = polygons ? 2 : GENERATE(2, 3);
  const std::size_t contacts = GENERATE(0, 5, 70000);  // none; some; more than one piece
  FrameFormat format;
  format.single = polygons;
  format.deflate = GENERATE(0, 4);
  CAPTURE(polygons, dim, contacts, format.deflate);
  const CommonFolder folder(ranks);
  const auto topology = small_topology(polygons, dim);
  Manifest manifest = small_manifest();
  manifest.dim = dim;
  // Where there are more ranks than particles some have no share.
  const Index n = topology.particles(), first = n * ranks.rank() / ranks.size(),
              last = n * (ranks.rank() + 1) / ranks.size();
  const auto write = [&](RunWriter& writer, int k) {
    const FrameData data(topology, k, contacts);
    writer.write_frame(Share(data, dim, first, last).frame, format);
  };
  {
    auto writer = RunWriter::create(folder.path() / "many", manifest, topology, small_geometry(), ranks);
    for (const int k : {0, 1}) write(writer, k);
    CHECK(writer.frames() == 2);
  }
  {
    // The second frame is written again, as after a restart.
    auto writer = RunWriter::append(folder.path() / "many", topology, 0, 1, 0, ranks);
    write(writer, 7);
  }
  if (!ranks.root()) return;
  {
    auto writer = RunWriter::create(folder.path() / "one", manifest, topology, small_geometry());
    for (const int k : {0, 7}) writer.write_frame(FrameData(topology, k, contacts).frame(), format);
  }
  CHECK(contents(folder.path() / "many" / "run.xdmf") == contents(folder.path() / "one" / "run.xdmf"));
  const auto many = hdf5::File::open_read(folder.path() / "many" / "run.h5"),
             one = hdf5::File::open_read(folder.path() / "one" / "run.h5");
  REQUIRE(many.open_group("frames").links() == std::vector<std::string>{"000000", "000001"});
  for (const std::string frame : {"frames/000000/", "frames/000001/"}) {
    for (const std::string group : {"", "contacts", "wall_contacts", "xdmf"}) {
      if (!one.has(frame + group)) continue;
      const auto names = one.open_group(frame + group).links();
      CHECK(many.open_group(frame + group).links() == names);
      for (const std::string& name : names) {
        const std::string path = frame + (group.empty() ? "" : group + "/") + name;
        CAPTURE(path);
        if (one.has_group(path)) continue;
        CHECK(many.shape(path) == one.shape(path));
        CHECK(many.holds_integers(path) == one.holds_integers(path));
        const bool equal = many.read<double>(path) == one.read<double>(path);  // avoids printing all values
        CHECK(equal);
      }
    }
  }
}

TEST_CASE("what a rank cannot write is everybody's error, and earlier frames stay", "[ranks]") {
  const Ranks ranks(PETSC_COMM_WORLD);
  const CommonFolder folder(ranks);
  CHECK_THROWS_WITH(SharedFile(ranks, folder.path() / "missing"), Contains("missing") && Contains("cannot write"));

  const auto topology = small_topology(true);
  auto writer = RunWriter::create(folder.path() / "run", small_manifest(), topology, small_geometry(), ranks);
  const FrameData data(topology, 0, 2000);
  const auto share = [&] {
    return Share(data, 2, ranks.rank() == ranks.size() - 1 ? 0 : 4, 4);  // the last rank owns all rows
  };
  writer.write_frame(share().frame);

  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
  auto* const handler = std::signal(SIGXFSZ, SIG_IGN);
  if (ranks.rank() == ranks.size() - 1) {
    const rlimit little{1000, before.rlim_max};
    REQUIRE(::setrlimit(RLIMIT_FSIZE, &little) == 0);
  }
  ExitCode code = ExitCode::done;
  try {
    writer.write_frame(share().frame);
  } catch (const Error& error) {
    code = error.code();
  }
  CHECK(code == ExitCode::output_failure);
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &before) == 0);
  std::signal(SIGXFSZ, handler);
  CHECK(writer.frames() == 1);
  writer.write_frame(share().frame);
  CHECK(writer.frames() == 2);
  writer.close();
  if (!ranks.root()) return;
  const auto file = hdf5::File::open_read(folder.path() / "run" / "run.h5");
  CHECK(file.open_group("frames").links() == std::vector<std::string>{"000000", "000001"});
  CHECK(file.read<Real>("frames/000001/positions", {18, 2}) == data.positions);
}

}  // namespace pliant::test::ranks_test
