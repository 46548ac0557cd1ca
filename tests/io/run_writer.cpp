#include <fmt/format.h>
#include <sys/resource.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>

#include <pliant/base/errors.h>
#include <pliant/io/recording.h>
#include <pliant/io/run_writer.h>

#include "io/io_support.h"

namespace pliant::test::run_writer_test {
using Catch::Matchers::Contains;
using hdf5::File;

namespace {

RunWriter new_run(const std::filesystem::path& folder, const Topology& topology) {
  Manifest manifest = small_manifest();
  manifest.dim = topology.dim;
  return RunWriter::create(folder, manifest, topology, small_geometry());
}

void add_sample(RunWriter& writer, double a) {
  const std::vector<Real> profile{a, 2 * a, 3 * a};
  writer.add_sample(std::vector<SeriesValue>{{"time", a}, {"profile_momentum", profile}, {"dt", 0.5 * a}});
}

/// Output of check_xdmf.py for the folder: "frames cells".
std::string check_xdmf(const std::filesystem::path& folder) {
  const auto script = std::filesystem::path(PLIANT_TEST_DATA).parent_path() / "io" / "check_xdmf.py";
  const std::string command = "/usr/bin/python3 " + script.string() + " " + folder.string() + " 2>&1";
  FILE* pipe = ::popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  std::string text;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) text += static_cast<char>(c);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 77) WARN("python3-h5py is missing: run.xdmf is not checked");
  return text.empty() || text.back() != '\n' ? text : text.substr(0, text.size() - 1);
}

std::vector<std::string> frame_names(const std::filesystem::path& folder) {
  return File::open_read(folder / "run.h5").open_group("frames").links();
}

}  // namespace

TEST_CASE("a later version adds columns to the series of a run") {
  const ScratchFolder scratch;
  const auto topology = small_topology(false, 2);
  {
    auto writer = new_run(scratch.path(), topology);
    for (int k = 0; k < 3; ++k) add_sample(writer, k);
    CHECK_THROWS_AS(writer.add_sample(std::vector<SeriesValue>{{"time", 3.0}, {"heat", 1.0}}), std::invalid_argument);
    writer.write_frame(FrameData(topology, 0, 2).frame());
  }
  const std::vector<Real> three{1, 2, 3}, two{4, 5};
  const auto longer = [&](RunWriter& writer, Real t) {
    writer.add_sample(std::vector<SeriesValue>{
        {"time", t}, {"profile_momentum", three}, {"dt", 0.1}, {"heat", 7 * t}, {"more", two}});
  };
  {
    auto writer = RunWriter::append(scratch.path(), topology, 2, 1);
    longer(writer, 2);
    longer(writer, 3);
    CHECK_THROWS_AS(add_sample(writer, 4), std::invalid_argument);
    writer.flush();
  }
  auto series = read_series(scratch.path());
  CHECK(series.at("time").values == std::vector<Real>{0, 1, 2, 3});
  const std::vector<Real>&heat = series.at("heat").values, &more = series.at("more").values;
  REQUIRE(heat.size() == 4);
  CHECK((std::isnan(heat[0]) && std::isnan(heat[1]) && heat[2] == 14 && heat[3] == 21));
  REQUIRE(more.size() == 8);
  CHECK((std::isnan(more[3]) && more[4] == 4 && more[7] == 5));
  {
    auto writer = RunWriter::append(scratch.path(), topology, 3, 1);
    longer(writer, 9);
  }
  CHECK(read_series(scratch.path()).at("heat").rows == 3);
}

TEST_CASE("a run holds what was written") {
  const bool polygons = GENERATE(true, false);
  const int dim = polygons ? 2 : GENERATE(2, 3);
  CAPTURE(polygons, dim);
  const ScratchFolder scratch;
  const auto folder = scratch / "deep/er";
  const auto topology = small_topology(polygons, dim);
  const auto n = static_cast<std::uint64_t>(topology.particles()),
             points = static_cast<std::uint64_t>(topology.points());
  const auto d = static_cast<std::uint64_t>(dim);
  const FrameData data(topology, 3, 5);
  {
    auto writer = new_run(folder, topology);
    writer.write_axis("profile_height", std::vector<Real>{1, 2, 3});
    writer.write_frame(data.frame());
    writer.close();
  }
  const auto file = File::open_read(folder / "run.h5");
  const auto manifest = file.open_group("manifest");
  CHECK(manifest.read_text("program") == "pliant");
  CHECK(manifest.read_text("hdf5_version") == hdf5::library_version());
  CHECK(manifest.integer_attribute("seed") == 7);
  CHECK(nlohmann::json::parse(manifest.read_text("options"))["hopper_width"]["unit"] == "sigma_avg");
  const auto table = nlohmann::json::parse(manifest.read_text("datasets"));
  CHECK(table["topology/a0"]["units"] == fmt::format("sigma_avg^{}", dim));
  CHECK(table["frames/*/velocities"]["units"] == "sigma_avg/t0");
  CHECK(file.read<Index>("topology/offset") == topology.offset);
  CHECK(file.read<Real>("topology/sigma") == topology.sigma);
  CHECK(file.read<Real>("topology/mass")[1] == Approx(polygons ? 2.0 : 1.0));
  CHECK(file.read<Real>("topology/diameter", {points}) == topology.diameter);
  CHECK(file.read<Real>("geometry/segments", {2, 4}) == small_geometry().segments);
  CHECK(file.open_group("geometry").real_attribute("angle") == 60);
  CHECK(file.read<Real>("series_axes/profile_height", {3})[2] == 3);

  const auto frame = file.open_group("frames/000000");
  CHECK(frame.real_attribute("time") == 0.1 * 3);
  CHECK(frame.integer_attribute("step") == 30);
  CHECK(frame.read<Real>("positions", {points, d}) == data.positions);
  CHECK(frame.read<Real>("velocities", {points, d}) == data.velocities);
  CHECK(frame.read<Real>("centres", {n, d}) == data.centres);
  CHECK(frame.read<std::uint8_t>("active", {n}) == data.active);
  CHECK(frame.read<Index>("contact_count", {n}) == data.contact_count);
  CHECK(frame.read<Real>("wall_force", {2, d}) == data.wall_force);
  CHECK(frame.has("area") == polygons);
  CHECK(frame.has("perimeter") == polygons);
  if (polygons) CHECK(frame.read<Real>("perimeter", {n}) == data.perimeter);
  CHECK(frame.read<Index>("contacts/particles", {5, 2}) == data.particles);
  CHECK(frame.read<Real>("contacts/position", {5, d}) == data.position);
  CHECK(frame.read<Real>("contacts/normal", {5, d}) == data.normal);
  CHECK(frame.read<Real>("contacts/overlap", {5}) == data.overlap);
  CHECK(frame.read<Real>("contacts/force", {5, d}) == data.force);

  CHECK(frame.read<Index>("reinsertions", {n}) == data.reinsertions);
  const auto partners = frame.read<Index>("wall_contacts/particle", {5}),
             walls = frame.read<Index>("wall_contacts/wall");
  for (std::size_t c = 0; c < 5; ++c)
    CHECK((partners[c] == data.at_walls[2 * c] && walls[c] == data.at_walls[2 * c + 1]));
  CHECK(frame.read<Real>("wall_contacts/position", {5, d}) == data.position);
  CHECK(frame.read<Real>("wall_contacts/normal", {5, d}) == data.normal);
  CHECK(frame.read<Real>("wall_contacts/overlap", {5}) == data.overlap);
  CHECK(frame.read<Real>("wall_contacts/force", {5, d}) == data.force);
}

namespace {

/// [rows, 2] with a third component of 0.
std::vector<Real> in_space(const std::vector<Real>& plane) {
  std::vector<Real> space;
  for (std::size_t k = 0; k < plane.size(); k += 2) space.insert(space.end(), {plane[k], plane[k + 1], 0});
  return space;
}

}  // namespace

TEST_CASE("frames have no copies for run.xdmf: centres of disks and vectors of three components are other names") {
  const bool polygons = GENERATE(true, false);
  const ScratchFolder scratch;
  const auto topology = small_topology(polygons);
  const FrameData data(topology, 1, 1000);
  {
    auto writer = new_run(scratch.path(), topology);
    for (int k = 0; k < 2; ++k) writer.write_frame(data.frame());
  }
  const auto file = File::open_read(scratch / "run.h5");
  const auto frame = file.open_group("frames/000001");
  CHECK(frame.read<Real>("xdmf/velocity") == in_space(data.velocities));
  CHECK(frame.read<Real>("xdmf/force") == in_space(data.force));
  CHECK(frame.read<Real>("xdmf/wall_contact_force") == in_space(data.force));
  CHECK(frame.read<Real>("xdmf/wall_force") == in_space(data.wall_force));
  CHECK(frame.read<Real>("centres") == data.centres);
  // All datasets that store values.
  std::uint64_t bytes = 0;
  for (const std::string& name : frame.datasets()) {
    CHECK(name.find("xdmf") == name.npos);
    std::uint64_t values = 1;
    for (const auto length : frame.shape(name)) values *= length;
    bytes += values * frame.value_size(name);
  }
  const std::uint64_t n = 4, points = topology.offset.back(), reals = 4 * points + (polygons ? 4 : 0) * n + 4;
  CHECK(bytes == 8 * reals + 9 * n + 1000 * (2 * 8 + 2 * 7 * 8));
  // In addition, some kilobytes for the structure of a frame.
  const auto end = std::filesystem::file_size(scratch / "run.h5");
  CHECK(end < 2 * bytes + 60000);
}

TEST_CASE("frames hold the fields that they are to hold") {
  const bool polygons = GENERATE(true, false);
  const int dim = polygons ? 2 : GENERATE(2, 3);
  CAPTURE(polygons, dim);
  const ScratchFolder scratch;
  const auto topology = small_topology(polygons, dim);
  const std::vector<std::string> lists{
      "positions",      "velocities", "contacts", "wall_contacts, wall_force", "contact_count,reinsertions",
      "area,perimeter", "all"};
  int cells = 0;
  {
    auto writer = new_run(scratch.path(), topology);
    for (int k = 0; k < static_cast<int>(lists.size()); ++k) {
      const std::string& list = lists[static_cast<std::size_t>(k)];
      writer.write_frame(FrameData(topology, k, 5).frame(), {.fields = parse_frame_fields(list)});
      cells += 4 + (dim == 2 ? 2 : 0) + (list == "contacts" || list.starts_with("wall") ? 5 : list == "all" ? 10 : 0);
    }
  }
  CHECK(check_xdmf(scratch.path()) == std::to_string(lists.size()) + " " + std::to_string(cells));
  { auto writer = RunWriter::append(scratch.path(), topology, 0, lists.size()); }  // writes run.xdmf again
  CHECK(check_xdmf(scratch.path()) == std::to_string(lists.size()) + " " + std::to_string(cells));

  const auto file = File::open_read(scratch / "run.h5");
  for (std::size_t k = 0; k < lists.size(); ++k) {
    const auto frame = file.open_group("frames/00000" + std::to_string(k));
    CAPTURE(lists[k]);
    for (const char* always : {"positions", "centres", "active"}) CHECK(frame.has(always));
    for (const std::string_view field : frame_field_names) {
      const bool wanted = lists[k] == "all" || lists[k].find(field) != std::string::npos;
      const bool known = field != "angles" && field != "spins" && field != "particle_stress" && field != "modes" &&
                         field != "volume" && field != "surface_area" &&
                         (polygons || (field != "area" && field != "perimeter"));
      const bool in_other = field == "contacts" && lists[k].starts_with("wall");
      CHECK(frame.has(std::string(field)) == (wanted && known && !in_other));
    }
  }
  const auto message = message_of<InputError>([] { parse_frame_fields("velocities,speed"); });
  CHECK_THAT(message, Contains("'speed'") &&
                          Contains("velocities, angles, spins, area, perimeter, volume, surface_area, reinsertions, "
                                   "contact_count, particle_stress, modes, contacts, wall_contacts, wall_force"));
  for (const char* wrong : {"", "velocities,", "All", "positions contacts"})
    CHECK_THROWS_AS(parse_frame_fields(wrong), InputError);
}

TEST_CASE("real numbers of frames in single precision, compressed") {
  const int dim = GENERATE(2, 3);
  const std::size_t contacts = GENERATE(7, 50000);  // of one chunk; of several, and of several pieces
  CAPTURE(dim, contacts);
  const ScratchFolder scratch;
  const auto topology = small_topology(dim == 2, dim);
  const FrameData data(topology, 1, contacts);
  std::vector<std::uintmax_t> sizes;
  for (const FrameFormat& format : {FrameFormat{}, FrameFormat{.single = true}, FrameFormat{.deflate = 9},
                                    FrameFormat{.single = true, .deflate = 1}}) {
    const auto folder = scratch / std::to_string(sizes.size());
    {
      auto writer = new_run(folder, topology);
      writer.write_frame(data.frame(), format);
    }
    sizes.push_back(std::filesystem::file_size(folder / "run.h5"));
    {
      const auto file = File::open_read(folder / "run.h5");
      const auto frame = file.open_group("frames/000000");
      for (const auto& [name, values] : std::map<std::string, std::vector<Real>>{{"positions", data.positions},
                                                                                 {"wall_contacts/force", data.force}}) {
        CHECK(frame.value_size(name) == (format.single ? 4 : 8));
        std::vector<Real> expected = values;
        if (format.single)
          for (Real& value : expected) value = static_cast<Real>(static_cast<float>(value));
        CHECK((frame.read<Real>(name) == expected));
      }
      CHECK((frame.read<Index>("contacts/particles") == data.particles));
    }
    // And the run can continue, in another format: all checksums agree.
    auto writer = RunWriter::append(folder, topology, 0, 1);
    CHECK(writer.damage().empty());
    if (contacts > 7) continue;
    writer.write_frame(FrameData(topology, 2, contacts).frame());
    writer.close();
    CHECK(check_xdmf(folder) == "2 " + std::to_string(2 * (4 + (dim == 2 ? 2 : 0) + 14)));
  }
  if (contacts > 7) {
    CHECK(sizes[1] < 0.6 * sizes[0]);
    CHECK(sizes[2] < 0.6 * sizes[0]);
    CHECK(sizes[3] < 0.8 * sizes[1]);
  } else {
    CHECK(sizes[2] < sizes[0] + 4000);  // compression must not cost more than it saves
  }
}

TEST_CASE("compression that the HDF5 library lacks is refused") {
  const FrameFormat format{.deflate = 4};
  CHECK_THAT(message_of<InputError>([&] { format.check(false); }),
             Contains("no compression") && Contains(hdf5::library_version()) && Contains("without deflate"));
  CHECK_NOTHROW(FrameFormat{}.check(false));
  CHECK(hdf5::can_deflate());
}

TEST_CASE("run.xdmf is valid after every frame and names only what is there") {
  const bool polygons = GENERATE(true, false);
  const int dim = polygons ? 2 : GENERATE(2, 3);
  CAPTURE(polygons, dim);
  const ScratchFolder scratch;
  const auto topology = small_topology(polygons, dim);
  auto writer = new_run(scratch.path(), topology);
  int cells = 0;
  for (int k = 0; k < 3; ++k) {
    const std::size_t contacts = k == 1 ? 0 : 2 + static_cast<std::size_t>(k);
    writer.write_frame(FrameData(topology, k, contacts).frame());
    cells += 4 + 2 * static_cast<int>(contacts) + (dim == 2 ? 2 : 0);
    // The writer has the file open: readers use a copy, as after a kill.
    const ScratchFolder copy;
    for (const char* name : {"run.h5", "run.xdmf"}) std::filesystem::copy(scratch / name, copy / name);
    CHECK(check_xdmf(copy.path()) == std::to_string(k + 1) + " " + std::to_string(cells));
  }
}

TEST_CASE("the check of run.xdmf finds mistakes") {
  const ScratchFolder scratch;
  const auto topology = small_topology(true);
  {
    auto writer = new_run(scratch.path(), topology);
    writer.write_frame(FrameData(topology, 0, 2).frame());
  }
  REQUIRE(check_xdmf(scratch.path()) == "1 10");
  std::string text = contents(scratch / "run.xdmf");
  const auto replace = [&](const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    REQUIRE(at != text.npos);
    text.replace(at, from.size(), to);
    std::ofstream(scratch / "run.xdmf") << text;
  };
  SECTION("shape") { replace("Dimensions=\"18 2\"", "Dimensions=\"17 2\""); }
  SECTION("path") { replace("xdmf/velocity", "xdmf/velocities"); }
  SECTION("vector") { replace("xdmf/velocity", "velocities"); }
  SECTION("field that a grid lacks") { replace("Name=\"overlap\"", "Name=\"other\""); }
  SECTION("XML") { replace("</Xdmf>", ""); }
  SECTION("type") { replace("NumberType=\"UChar\" Precision=\"1\"", "NumberType=\"Int\" Precision=\"4\""); }
  CHECK_THAT(check_xdmf(scratch.path()), Contains(scratch.path().string()));
}

TEST_CASE("a recorder's objects are those of a run in a folder, without views and data of run.xdmf") {
  const bool polygons = GENERATE(true, false);
  const FrameFormat format{.single = GENERATE(false, true), .deflate = hdf5::can_deflate() ? GENERATE(0, 4) : 0};
  const ScratchFolder scratch;
  const auto topology = small_topology(polygons);
  Manifest manifest = small_manifest();
  manifest.dim = topology.dim;
  const auto write_to = [&](RunWriter& writer) {
    writer.write_axis("angles", std::vector<Real>{1, 2, 3});
    for (int k = 0; k < 3; ++k) {
      add_sample(writer, 0.5 * k);
      writer.write_frame(FrameData(topology, k, k == 0 ? 0 : 5).frame(), format);
    }
  };
  auto writer = RunWriter::create(scratch.path(), manifest, topology, small_geometry());
  write_to(writer);
  writer.close();
  auto recorder = RunWriter::recorder(manifest, topology, small_geometry());
  write_to(recorder);
  const std::string message = recorder.recorded();
  CHECK(recorder.recorded() == message);
  {
    auto file = File::create(scratch / "members.h5");
    file.create_group("member").add(message);
    file.close();
  }
  const auto whole = File::open_read(scratch / "run.h5"), file = File::open_read(scratch / "members.h5");
  const auto member = file.open_group("member");
  std::vector<std::string> names = whole.datasets(), found = member.datasets();
  // The positions of disks have a second name, "centres", in a member.
  const auto differs = [](const std::string& name) {
    return name.find("xdmf") != name.npos || name.ends_with("positions");
  };
  std::erase_if(names, differs);
  std::erase_if(found, differs);
  CHECK(found == names);
  for (const std::string& name : names) {
    CAPTURE(name);
    member.check(name);
    if (name.starts_with("manifest") || name == "geometry/kind") {
      CHECK(member.read_text(name) == whole.read_text(name));
      continue;
    }
    REQUIRE(member.shape(name) == whole.shape(name));
    CHECK(member.value_size(name) == whole.value_size(name));
    CHECK(member.read<double>(name) == whole.read<double>(name));
  }
  const auto frame = member.open_group("frames/000001"), frame_in_folder = whole.open_group("frames/000001");
  for (const char* name : {"positions", "centres"})
    CHECK(frame.read<double>(name) == frame_in_folder.read<double>(name));
  CHECK(frame.has("contacts/friction") == frame_in_folder.has("contacts/friction"));
  CHECK(frame.real_attribute("time") == frame_in_folder.real_attribute("time"));
  CHECK(frame.integer_attribute("step") == frame_in_folder.integer_attribute("step"));
  CHECK(member.open_group("frames").integer_attribute("members") == 3);
  CHECK(member.open_group("geometry").real_attribute("angle") == 60);
}

TEST_CASE("series rows are kept until a frame, a flush or the end") {
  const ScratchFolder scratch;
  const auto topology = small_topology(false);
  auto writer = new_run(scratch.path(), topology);
  for (int i = 0; i < 1000; ++i) add_sample(writer, i);
  CHECK(writer.samples() == 1000);
  writer.write_frame(FrameData(topology, 0, 0).frame());
  for (int i = 1000; i < 1500; ++i) add_sample(writer, i);
  const auto now = writer.read_series();
  CHECK(now.at("time").rows == 1500);
  add_sample(writer, 1500);
  writer.close();

  const auto series = read_series(scratch.path());
  REQUIRE(series.size() == 3);
  for (const auto& [name, column] : series) CHECK(column.rows == 1501);
  CHECK(series.at("profile_momentum").width == 3);
  CHECK(series.at("profile_momentum").values[3 * 1234 + 2] == 3 * 1234);
  CHECK(series.at("dt").values[1500] == 750);
}

TEST_CASE("events are rows of their own, and a restart cuts them") {
  const ScratchFolder scratch;
  const auto topology = small_topology(false);
  const auto add_event = [](RunWriter& writer, double a) {
    const std::vector<Real> pair{a, a + 1};
    writer.add_event(std::vector<SeriesValue>{{"time", a}, {"particles", pair}});
  };
  {
    auto writer = new_run(scratch.path(), topology);
    add_sample(writer, 0);
    for (int k = 0; k < 5; ++k) add_event(writer, k);
    CHECK(writer.events() == 5);
    CHECK(writer.samples() == 1);
    writer.write_frame(FrameData(topology, 0, 0).frame());
    add_event(writer, 5);
    writer.close();
  }
  const auto pairs = [&] { return File::open_read(scratch / "run.h5").read<Real>("/events/particles"); };
  CHECK(pairs() == std::vector<Real>{0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6});
  {
    auto writer = RunWriter::append(scratch.path(), topology, 1, 1, 2);
    CHECK(writer.events() == 2);
    add_event(writer, 7);
    writer.close();
  }
  CHECK(pairs() == std::vector<Real>{0, 1, 1, 2, 7, 8});
  CHECK(read_series(scratch.path()).at("time").rows == 1);
  CHECK_THROWS_AS(RunWriter::append(scratch.path(), topology, 1, 1, 4), InputError);
}

TEST_CASE("walls that move are drawn where they are") {
  const ScratchFolder scratch;
  const auto topology = small_topology(false);
  const std::vector<Real> walls{0, 0, 1, 1, 2, 0.5, 3, 1.5};
  {
    auto writer = new_run(scratch.path(), topology);
    const FrameData data(topology, 0, 2);
    Frame frame = data.frame();
    frame.wall_segments = walls;
    writer.write_frame(frame);
  }
  CHECK(File::open_read(scratch / "run.h5").read<Real>("/frames/000000/wall_segments", {2, 4}) == walls);
  CHECK(contents(scratch / "run.xdmf").find("/frames/000000/xdmf/wall_points") != std::string::npos);
  CHECK(check_xdmf(scratch.path()) == "1 10");
  {
    auto writer = RunWriter::append(scratch.path(), topology, 0, 1);  // writes run.xdmf again
    CHECK(contents(scratch / "run.xdmf").find("/frames/000000/xdmf/wall_points") != std::string::npos);
  }
}

TEST_CASE("a sample with other columns than the first is refused whole") {
  const ScratchFolder scratch;
  auto writer = new_run(scratch.path(), small_topology(false));
  add_sample(writer, 1);
  const std::vector<Real> longer(4, 0), row(3, 0);
  using Sample = std::vector<SeriesValue>;
  CHECK_THROWS_AS(writer.add_sample(Sample{{"time", 1.0}, {"profile_momentum", longer}, {"dt", 1.0}}),
                  std::invalid_argument);
  CHECK_THROWS_AS(writer.add_sample(Sample{{"time", 1.0}, {"profile_momentum", row}}), std::invalid_argument);
  CHECK_THROWS_AS(writer.add_sample(Sample{{"time", 1.0}, {"profile_momentum", row}, {"other", 1.0}}),
                  std::invalid_argument);
  for (const auto& [name, column] : writer.read_series()) CHECK(column.rows == 1);
}

TEST_CASE("folders that cannot take a run") {
  const ScratchFolder scratch;
  const auto topology = small_topology(false);
  SECTION("holds a run: nothing is touched") {
    { new_run(scratch.path(), topology).write_frame(FrameData(topology, 0, 0).frame()); }
    const std::string before = contents(scratch / "run.h5");
    CHECK_THAT(message_of<InputError>([&] { new_run(scratch.path(), topology); }),
               Contains("run.h5") && Contains("another folder"));
    CHECK(contents(scratch / "run.h5") == before);
  }
  SECTION("holds a checkpoint") {
    std::ofstream(scratch / "checkpoint-b.h5") << "x";
    CHECK_THROWS_AS(new_run(scratch.path(), topology), InputError);
  }
  SECTION("is a file") {
    std::ofstream(scratch / "file") << "x";
    CHECK_THAT(message_of<OutputError>([&] { new_run(scratch / "file", topology); }),
               Contains("choose another folder"));
    CHECK_THAT(message_of<OutputError>([&] { new_run(scratch / "file/below", topology); }),
               Contains("choose another folder"));
    CHECK(contents(scratch / "file") == "x");
  }
  SECTION("may not be written") {
    std::filesystem::create_directory(scratch / "mine");
    std::filesystem::permissions(scratch.path(), std::filesystem::perms(0755));
    std::filesystem::permissions(scratch / "mine", std::filesystem::perms(0555));
    const int status = in_child([&] {
      if (::geteuid() == 0 && ::setuid(65534) != 0) return 1;  // root may write anywhere
      const auto here = message_of<OutputError>([&] { new_run(scratch / "mine", topology); });
      const auto below = message_of<OutputError>([&] { new_run(scratch / "mine/run", topology); });
      return here.find("Permission denied") != here.npos && below.find("Permission denied") != below.npos ? 0 : 2;
    });
    CHECK(status == 0);
  }
  SECTION("nothing to append to") { CHECK_THROWS_AS(RunWriter::append(scratch / "none", topology, 0, 0), InputError); }
}

TEST_CASE("a restart cuts the series, and replaces frames when it comes to them") {
  const ScratchFolder scratch;
  const auto topology = small_topology(true);
  {
    auto writer = new_run(scratch.path(), topology);
    writer.write_axis("profile_height", std::vector<Real>{1, 2, 3});
    for (int k = 0; k < 4; ++k) {
      add_sample(writer, k);
      add_sample(writer, k + 0.5);
      writer.write_frame(FrameData(topology, k, 2).frame());
    }
  }
  const auto positions = [&](const std::string& frame) {
    return File::open_read(scratch / "run.h5").read<Real>("frames/" + frame + "/positions");
  };
  {
    auto writer = RunWriter::append(scratch.path(), topology, 5, 2);
    CHECK(writer.frames() == 2);
    CHECK(writer.samples() == 5);
    writer.write_axis("profile_height", std::vector<Real>{1, 2, 3});
    CHECK(writer.read_series().at("time").values == std::vector<Real>{0, 0.5, 1, 1.5, 2});
  }
  CHECK(frame_names(scratch.path()).size() == 4);  // reading loses no frame
  CHECK(check_xdmf(scratch.path()) == "4 40");
  {
    auto writer = RunWriter::append(scratch.path(), topology, 5, 2);
    add_sample(writer, 9);
    FrameData other(topology, 2, 3);
    other.positions[0] = -77;
    writer.write_frame(other.frame());
  }
  CHECK(frame_names(scratch.path()).size() == 4);
  CHECK(positions("000001") == FrameData(topology, 1, 0).positions);
  CHECK(positions("000002")[0] == -77);
  CHECK(positions("000003") == FrameData(topology, 3, 0).positions);
  CHECK(check_xdmf(scratch.path()) == "3 32");
  const auto series = read_series(scratch.path());
  CHECK(series.at("time").values == std::vector<Real>{0, 0.5, 1, 1.5, 2, 9});
  CHECK(series.at("profile_momentum").values.back() == 27);
  CHECK(series.at("profile_momentum").rows == 6);
  {
    auto writer = RunWriter::append(scratch.path(), topology, 6, 3);
    for (int k = 3; k < 6; ++k) writer.write_frame(FrameData(topology, k, 2).frame());
  }
  CHECK(frame_names(scratch.path()).size() == 6);
  CHECK(check_xdmf(scratch.path()) == "6 62");
  {
    auto writer = RunWriter::append(scratch.path(), topology, 6, 4);
    writer.drop_later_frames();
    CHECK(check_xdmf(scratch.path()) == "4 42");
    writer.write_frame(FrameData(topology, 4, 2).frame());
    writer.drop_later_frames();
  }
  CHECK(frame_names(scratch.path()).size() == 5);
  CHECK(check_xdmf(scratch.path()) == "5 52");

  // Inconsistent data are refused.
  CHECK_THROWS_AS(RunWriter::append(scratch.path(), topology, 7, 3), InputError);
  CHECK_THROWS_AS(RunWriter::append(scratch.path(), topology, 6, 7), InputError);
  CHECK_THROWS_AS(RunWriter::append(scratch.path(), small_topology(false), 6, 3), InputError);
}

TEST_CASE("a killed run is read up to its last frame") {
  const ScratchFolder scratch;
  const auto topology = small_topology(true);
  const int status = in_child([&] {
    auto writer = new_run(scratch.path(), topology);
    for (int k = 0; k < 5; ++k) {
      add_sample(writer, k);
      writer.write_frame(FrameData(topology, k, 2).frame());
    }
    add_sample(writer, 5);
    return ::kill(::getpid(), SIGKILL);
  });
  REQUIRE(WIFSIGNALED(status));
  CHECK(frame_names(scratch.path()).size() == 5);
  CHECK(File::open_read(scratch / "run.h5").read<Real>("frames/000004/positions") ==
        FrameData(topology, 4, 0).positions);
  CHECK(read_series(scratch.path()).at("time").values == std::vector<Real>{0, 1, 2, 3, 4});
  CHECK(check_xdmf(scratch.path()) == "5 50");
  // And the run can continue.
  { RunWriter::append(scratch.path(), topology, 5, 5).write_frame(FrameData(topology, 5, 2).frame()); }
  CHECK(check_xdmf(scratch.path()) == "6 60");
}

TEST_CASE("a full disk stops the run and keeps the frames before") {
  // A limit on the size of files fails as a full disk does, at any byte and without a separate file system.
  const rlim_t room = GENERATE(0, 1, 1000, 20000, 100000, 180000, 200000);
  CAPTURE(room);
  const ScratchFolder scratch;
  const auto topology = small_topology(true);
  const int status = in_child([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    auto writer = new_run(scratch.path(), topology);
    for (int k = 0; k < 3; ++k) {
      add_sample(writer, k);
      writer.write_frame(FrameData(topology, k, 2).frame());
    }
    writer.flush();
    const rlim_t size = static_cast<rlim_t>(std::filesystem::file_size(scratch / "run.h5")) + room;
    const rlimit limit{size, size};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const auto text = message_of<OutputError>([&] {
      for (int k = 3; k < 100; ++k) {
        add_sample(writer, k);
        writer.write_frame(FrameData(topology, k, 2000).frame());
      }
    });
    return text.find("run.h5") != text.npos && text.find("File too large") != text.npos ? 0 : 1;
  });
  CHECK(status == 0);
  const auto frames = static_cast<int>(frame_names(scratch.path()).size());
  REQUIRE(frames >= 3);
  for (int k = 0; k < frames; ++k)
    CHECK(File::open_read(scratch / "run.h5").read<Real>("frames/00000" + std::to_string(k) + "/positions") ==
          FrameData(topology, k, 0).positions);
  CHECK(static_cast<int>(read_series(scratch.path()).at("time").rows) >= frames);
  CHECK_THAT(check_xdmf(scratch.path()), Catch::Matchers::StartsWith(std::to_string(frames) + " "));
}

namespace {

void change_byte(const std::filesystem::path& path, std::size_t at, int bit = 0) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(static_cast<std::streamoff>(at));
  const char changed = static_cast<char>(file.get() ^ (1 << bit));
  file.seekp(static_cast<std::streamoff>(at));
  file.put(changed);
}

/// Changes a value wherever the file holds it: the unused end of a chunk may hold a copy from HDF5's memory.
template <class T>
void change_value(const std::filesystem::path& path, const T& value) {
  const std::string bytes = contents(path), sought(reinterpret_cast<const char*>(&value), sizeof value);
  REQUIRE(bytes.find(sought) != bytes.npos);
  for (auto at = bytes.find(sought); at != bytes.npos; at = bytes.find(sought, at + sizeof value))
    change_byte(path, at);
}
/// Place of the text number `n` in the file.
std::size_t place_of_text(const std::filesystem::path& path, const std::string& text, int n) {
  const std::string bytes = contents(path);
  std::size_t at = bytes.find(text);
  for (; n > 0; --n) at = bytes.find(text, at + 1);
  REQUIRE(at != bytes.npos);
  return at;
}

/// All readable data of a run, as text.
std::string everything(const std::filesystem::path& folder) {
  const auto file = File::open_read(folder / "run.h5");
  std::string text;
  const auto add = [&](const hdf5::Group& group, const std::string& name) {
    text += name;
    for (const double value : group.read<double>(name)) text += fmt::format(" {}", value);
  };
  for (const char* name : {"topology", "geometry", "series_axes", "series"}) {
    const auto group = file.open_group(name);
    for (const std::string& dataset : group.datasets())
      dataset == "kind" ? void(text += group.read_text(dataset)) : add(group, dataset);
  }
  for (const std::string& name : file.open_group("manifest").datasets()) text += file.read_text("manifest/" + name);
  for (const std::string& name : file.open_group("frames").links()) {
    const auto frame = file.open_group("frames/" + name);
    text += fmt::format("{} {} {}", name, frame.real_attribute("time"), frame.integer_attribute("step"));
    for (const std::string& dataset : frame.datasets()) add(frame, dataset);  // views are for other readers
  }
  return text;
}

}  // namespace

TEST_CASE("a restart says what is damaged, and goes on where only frames are") {
  const ScratchFolder scratch;
  const auto path = scratch / "run.h5";
  const auto topology = small_topology(true);
  {
    auto writer = new_run(scratch.path(), topology);
    writer.write_axis("profile_height", std::vector<Real>{7.25, 2, 3});
    for (int k = 0; k < 3; ++k) {
      add_sample(writer, k + 0.125);
      writer.write_frame(FrameData(topology, k, 2).frame());
    }
  }
  const auto refused = [&] {
    return message_of<InputError>([&] { RunWriter::append(scratch.path(), topology, 3, 3); });
  };
  REQUIRE(RunWriter::append(scratch.path(), topology, 3, 3).damage().empty());
  SECTION("values of a frame") {
    change_value(path, FrameData(topology, 1, 2).centres[3]);
    {
      auto writer = RunWriter::append(scratch.path(), topology, 3, 3);
      REQUIRE(writer.damage().size() == 1);
      CHECK_THAT(writer.damage()[0], Contains("/frames/000001/centres") && Contains("run.h5"));
      writer.write_frame(FrameData(topology, 3, 2).frame());
    }
    // The missing part is needed only when the run reaches it again.
    CHECK(RunWriter::append(scratch.path(), topology, 3, 1).damage().empty());
    CHECK(check_xdmf(scratch.path()) == "4 40");
  }
  SECTION("the head of a frame") {
    change_byte(path, place_of_text(path, "perimeter", 3));  // two are in /manifest/datasets
    {
      auto writer = RunWriter::append(scratch.path(), topology, 3, 3);
      REQUIRE(writer.damage().size() == 1);
      CHECK_THAT(writer.damage()[0], Contains("/frames/000001"));
    }
    // HDF5 cannot take it out of its list.
    CHECK_THAT(message_of<InputError>([&] { RunWriter::append(scratch.path(), topology, 3, 1); }),
               Contains("/frames/000001") && Contains("cannot write this frame again"));
  }
  SECTION("a series") {
    change_value(path, 0.5 * 1.125);
    CHECK_THAT(refused(), Contains("/series/dt") && Contains("damaged"));
  }
  SECTION("an axis") {
    change_value(path, 7.25);
    CHECK_THAT(refused(), Contains("/series_axes/profile_height"));
  }
  SECTION("the manifest") {
    change_byte(path, place_of_text(path, "sigma_avg", 0));
    CHECK_THAT(refused(), Contains("/manifest"));
  }
}

TEST_CASE("a flipped bit is noticed, or changes nothing that can be read") {
  const ScratchFolder scratch;
  const auto topology = small_topology(true);
  {
    auto writer = new_run(scratch / "run", topology);
    writer.write_axis("profile_height", std::vector<Real>{1, 2, 3});
    for (int k = 0; k < 4; ++k) {
      for (int i = 0; i < 20; ++i) add_sample(writer, k + 0.01 * i);
      writer.write_frame(FrameData(topology, k, 30).frame());
    }
  }
  const std::string whole = everything(scratch / "run");
  const auto size = std::filesystem::file_size(scratch / "run/run.h5");
  std::filesystem::create_directory(scratch / "copy");
  int noticed = 0;
  // In many places, and, closer, around the texts of the manifest.
  const std::size_t texts = place_of_text(scratch / "run/run.h5", "sigma_avg", 0) - 200;
  constexpr int flips = 60, in_texts = 40;
  for (int k = 0; k < flips + in_texts; ++k) {
    const auto path = scratch / "copy/run.h5";
    std::filesystem::copy(scratch / "run/run.h5", path, std::filesystem::copy_options::overwrite_existing);
    change_byte(path,
                k < flips ? (static_cast<std::uint64_t>(k) * 7919 * 104729) % size
                          : texts + static_cast<std::size_t>(k - flips) * 9,
                k % 8);
    const int status = in_child([&] {
      try {
        if (!RunWriter::append(scratch / "copy", topology, 80, 4).damage().empty()) return 1;
      } catch (const InputError&) {
        return 1;
      }
      return everything(scratch / "copy") == whole ? 0 : 2;
    });
    CAPTURE(k);
    CHECK(WIFEXITED(status));
    CHECK(WEXITSTATUS(status) < 2);
    noticed += WEXITSTATUS(status) == 1;
  }
  WARN(noticed << " of " << flips + in_texts << " flips were noticed");
  CHECK(noticed > flips / 4);
}

TEST_CASE("a run whose file is removed ends") {
  const ScratchFolder scratch;
  const auto topology = small_topology(true);
  auto writer = new_run(scratch.path(), topology);
  writer.write_frame(FrameData(topology, 0, 2).frame());
  std::filesystem::remove(scratch / "run.h5");
  const FrameData next(topology, 1, 2);
  CHECK_THAT(message_of<OutputError>([&] { writer.write_frame(next.frame()); }), Contains("run.h5 was removed"));
}

}  // namespace pliant::test::run_writer_test
