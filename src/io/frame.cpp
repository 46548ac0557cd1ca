#include <pliant/io/frame.h>

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <type_traits>

#include <pliant/base/cure.h>
#include <pliant/base/errors.h>

namespace pliant {
namespace {

/// The rows of one kind: of this rank, and of all ranks.
struct Rows {
  std::uint64_t first = 0, count = 0, all = 0;

  Rows(std::uint64_t mine, const Ranks& ranks) : count(mine) {
    const std::vector<std::uint64_t> counts = ranks.all_gather(std::vector{mine});
    for (int r = 0; r < ranks.size(); ++r) {
      if (r < ranks.rank()) first += counts[static_cast<std::size_t>(r)];
      all += counts[static_cast<std::size_t>(r)];
    }
  }
};

/// How the datasets of a frame are made of its arrays.
class Storing {
 public:
  explicit Storing(bool single) : single_(single) {}

  template <class T>
  FrameArray operator()(std::string name, const Rows& rows, std::uint64_t width, std::span<const T> values) const {
    if (values.size() != rows.count * width)
      throw std::invalid_argument("run.h5: the arrays of a frame do not fit together: " + name);
    return made<T>(std::move(name), rows, width, Strided<T>{values.data(), width * sizeof(T)});
  }
  template <class T>
  FrameArray operator()(std::string name, const Rows& rows, std::uint64_t width, const Strided<T>& values) const {
    return made<T>(std::move(name), rows, width, values);
  }

 private:
  template <class T>
  FrameArray made(std::string name, const Rows& rows, std::uint64_t width, const Strided<T>& values) const {
    if constexpr (std::is_same_v<T, Real>)
      if (single_) return converted<float>(std::move(name), rows, width, values);
    return converted<T>(std::move(name), rows, width, values);
  }

  template <class Stored, class T>
  static FrameArray converted(std::string name, const Rows& rows, std::uint64_t width, const Strided<T>& values) {
    const auto make = [=](std::uint64_t from, std::uint64_t count, void* to) {
      auto* out = static_cast<Stored*>(to);
      for (std::uint64_t row = from; row < from + count; ++row)
        out = std::transform(values[row], values[row] + width, out, [](T value) { return static_cast<Stored>(value); });
    };
    return {std::move(name),
            hdf5::type_of<Stored>(),
            width == 1 ? hdf5::Shape{rows.all} : hdf5::Shape{rows.all, width},
            rows.first,
            rows.count,
            make};
  }

  bool single_;
};

}  // namespace

std::set<std::string, std::less<>> parse_frame_fields(std::string_view list) {
  if (list == "all") return FrameFormat().fields;
  std::set<std::string, std::less<>> fields;
  for (std::size_t at = 0; at <= list.size();) {
    const std::size_t end = std::min(list.find(',', at), list.size());
    std::string_view field = list.substr(at, end - at);
    while (field.starts_with(' ')) field.remove_prefix(1);
    while (field.ends_with(' ')) field.remove_suffix(1);
    if (std::ranges::find(frame_field_names, field) != frame_field_names.end())
      fields.emplace(field);
    else if (field != "positions")
      throw InputError("there is no field '{}'; choose all, or of positions (always written), {}", field,
                       fmt::join(frame_field_names, ", "));
    at = end + 1;
  }
  return fields;
}

void FrameFormat::check(bool can_deflate) const {
  if (deflate > 0 && !can_deflate)
    throw InputError(
        "frames cannot be compressed: this HDF5 library, version {}, was built without deflate; use {}, or a library "
        "with zlib",
        hdf5::library_version(), cures({Cure::no_compression}));
}

FrameLayout::FrameLayout(const Frame& frame, int dimensions, const Ranks& ranks, const FrameFormat& format) {
  const auto dim = static_cast<std::uint64_t>(dimensions);
  const Rows particle(frame.active.size(), ranks), point(frame.positions.size() / dim, ranks);
  particles = particle.all;
  points = point.all;
  own_centres = points > particles;
  if (frame.offset.size() != particle.count + 1 || static_cast<std::uint64_t>(frame.offset.back()) != point.count)
    throw std::invalid_argument("run.h5: the arrays of a frame do not fit together: offset");

  const Storing stored(format.single);
  arrays.push_back(stored("positions", point, dim, frame.positions));
  if (own_centres) arrays.push_back(stored("centres", particle, dim, frame.centres));
  arrays.push_back(stored("active", particle, 1, frame.active));
  if (ranks.any(!frame.images.empty())) arrays.push_back(stored("images", particle, dim, frame.images));

  const auto add = [&](const char* name, const Rows& rows, std::uint64_t width, const auto& values) {
    if (format.has(name)) arrays.push_back(stored(name, rows, width, values));
  };
  add("velocities", point, dim, frame.velocities);
  if (ranks.any(!frame.angles.empty())) {
    const std::uint64_t width = dim == 2 ? 1 : 3;
    add("angles", particle, width, frame.angles);
    add("spins", particle, width, frame.spins);
  }
  if (ranks.any(!frame.area.empty())) {
    add("area", particle, 1, frame.area);
    add("perimeter", particle, 1, frame.perimeter);
  }
  if (ranks.any(!frame.volume.empty())) {
    add("volume", particle, 1, frame.volume);
    add("surface_area", particle, 1, frame.surface_area);
  }
  if (ranks.any(!frame.reinsertions.empty())) add("reinsertions", particle, 1, frame.reinsertions);
  add("contact_count", particle, 1, frame.contact_count);
  if (ranks.any(!frame.particle_stress.empty()))
    add("particle_stress", particle, dim * (dim + 1) / 2, frame.particle_stress);
  if (frame.mode_width > 0) add("modes", point, frame.mode_width, frame.modes);
  const auto add_contacts = [&](const std::string& group, const FrameContacts& contacts, auto&& add_partners) {
    if (!format.has(group)) return;
    const Rows rows(contacts.count, ranks);
    add_partners(rows);
    arrays.push_back(stored(group + "/position", rows, dim, contacts.position));
    arrays.push_back(stored(group + "/normal", rows, dim, contacts.normal));
    arrays.push_back(stored(group + "/overlap", rows, 1, contacts.overlap));
    arrays.push_back(stored(group + "/force", rows, dim, contacts.force));
    if (ranks.any(contacts.friction.data != nullptr))
      arrays.push_back(stored(group + "/friction", rows, dim, contacts.friction));
  };
  add_contacts("contacts", frame.contacts, [&](const Rows& rows) {
    arrays.push_back(stored("contacts/particles", rows, 2, frame.contacts.particles));
  });
  add_contacts("wall_contacts", frame.wall_contacts, [&](const Rows& rows) {
    const Strided<Index>& pairs = frame.wall_contacts.particles;
    arrays.push_back(stored("wall_contacts/particle", rows, 1, pairs));
    const Index* const walls = pairs.data != nullptr ? pairs.data + 1 : nullptr;
    arrays.push_back(stored("wall_contacts/wall", rows, 1, Strided<Index>{walls, pairs.stride}));
  });
}

}  // namespace pliant
