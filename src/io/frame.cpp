#include <pliant/io/frame.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <pliant/io/xdmf.h>

namespace pliant {
namespace {

/// The rows of one kind: this rank's, and those of all.
struct Rows {
  std::uint64_t first = 0, count = 0, all = 0;

  Rows(std::uint64_t mine, const Ranks& ranks) : count(mine) {
    const std::vector<std::uint64_t> counts = ranks.all_gather(std::vector{mine});
    for (int r = 0; r < ranks.size(); ++r) {
      if (r < ranks.rank()) first += counts[static_cast<std::size_t>(r)];
      all += counts[static_cast<std::size_t>(r)];
    }
  }
  Rows times(std::uint64_t each) const { return {first * each, count * each, all * each}; }

 private:
  Rows(std::uint64_t first_row, std::uint64_t mine, std::uint64_t of_all)
      : first(first_row), count(mine), all(of_all) {}
};

/// fill(from, values) makes whole rows from this rank's row `from` on.
template <class T, class Fill>
FrameArray made(std::string name, const Rows& rows, std::uint64_t width, Fill fill) {
  return {std::move(name),
          hdf5::type_of<T>(),
          width == 1 ? hdf5::Shape{rows.all} : hdf5::Shape{rows.all, width},
          rows.first,
          rows.count,
          [=](std::uint64_t from, std::uint64_t count, void* to) {
            fill(from, std::span(static_cast<T*>(to), count * width));
          }};
}

template <class T>
FrameArray stored(std::string name, const Rows& rows, std::uint64_t width, std::span<const T> values) {
  if (values.size() != rows.count * width)
    throw std::invalid_argument("run.h5: the arrays of a frame do not fit together: " + name);
  return made<T>(std::move(name), rows, width, [=](std::uint64_t from, std::span<T> to) {
    std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(from * width), to.size(), to.begin());
  });
}

template <class T>
FrameArray stored(std::string name, const Rows& rows, std::uint64_t width, const Strided<T>& values) {
  return made<T>(std::move(name), rows, width, [=](std::uint64_t from, std::span<T> to) {
    for (std::size_t k = 0; k < to.size(); k += width) std::copy_n(values[from + k / width], width, &to[k]);
  });
}

Real norm(const Real* a, std::size_t dim) {
  Real sum = 0;
  for (std::size_t k = 0; k < dim; ++k) sum += square(a[k]);
  return std::sqrt(sum);
}

}  // namespace

FrameLayout::FrameLayout(const Frame& frame, int dimensions, const Ranks& ranks) {
  const auto dim = static_cast<std::uint64_t>(dimensions);
  const Rows particle(frame.active.size(), ranks), point(frame.positions.size() / dim, ranks),
      contact(frame.contacts.count, ranks);
  particles = particle.all;
  points = point.all;
  contacts = contact.all;
  if (frame.offset.size() != particle.count + 1 || static_cast<std::uint64_t>(frame.offset.back()) != point.count)
    throw std::invalid_argument("run.h5: the arrays of a frame do not fit together: offset");

  arrays.push_back(stored("positions", point, dim, frame.positions));
  arrays.push_back(stored("velocities", point, dim, frame.velocities));
  arrays.push_back(stored("centres", particle, dim, frame.centres));
  if (ranks.any(!frame.angles.empty())) {
    const std::uint64_t width = dim == 2 ? 1 : 3;
    arrays.push_back(stored("angles", particle, width, frame.angles));
    arrays.push_back(stored("spins", particle, width, frame.spins));
  }
  arrays.push_back(stored("active", particle, 1, frame.active));
  if (ranks.any(!frame.images.empty())) arrays.push_back(stored("images", particle, dim, frame.images));
  arrays.push_back(stored("contact_count", particle, 1, frame.contact_count));
  arrays.push_back(stored("contacts/particles", contact, 2, frame.contacts.particles));
  arrays.push_back(stored("contacts/position", contact, dim, frame.contacts.position));
  arrays.push_back(stored("contacts/normal", contact, dim, frame.contacts.normal));
  arrays.push_back(stored("contacts/overlap", contact, 1, frame.contacts.overlap));
  arrays.push_back(stored("contacts/force", contact, dim, frame.contacts.force));

  arrays.push_back(made<Real>("xdmf/speed", particle, 1, [&frame, dim](std::uint64_t from, std::span<Real> speed) {
    for (std::size_t k = 0; k < speed.size(); ++k) {
      const Index first = frame.offset[from + k], last = frame.offset[from + k + 1];
      std::array<Real, 3> sum{};  // the points of a particle have equal masses
      for (Index i = first; i < last; ++i)
        for (std::size_t d = 0; d < dim; ++d) sum[d] += frame.velocities[static_cast<std::size_t>(i) * dim + d];
      speed[k] = norm(sum.data(), dim) / (last - first);
    }
  }));
  polygons = ranks.any(!frame.a0.empty());
  if (polygons) {
    arrays.push_back(stored("area", particle, 1, frame.area));
    arrays.push_back(stored("perimeter", particle, 1, frame.perimeter));
    arrays.push_back(made<Real>("xdmf/area_ratio", particle, 1, [&frame](std::uint64_t from, std::span<Real> ratio) {
      for (std::size_t k = 0; k < ratio.size(); ++k) ratio[k] = frame.area[from + k] / frame.a0[from + k];
    }));
  }
  // A contact is a line.
  arrays.push_back(
      made<Real>("xdmf/contact_points", contact.times(2), dim, [&frame, dim](std::uint64_t from, std::span<Real> ends) {
        for (std::size_t k = 0; k < ends.size(); k += dim) {
          const std::size_t end = from + k / dim;
          std::copy_n(frame.contacts.ends[end / 2] + end % 2 * dim, dim, &ends[k]);
        }
      }));
  const Rows cells = contact.times(4);
  arrays.push_back(made<std::int32_t>("xdmf/contact_connectivity", cells, 1,
                                      [first = cells.first](std::uint64_t from, std::span<std::int32_t> cell) {
                                        for (std::size_t k = 0; k < cell.size(); ++k)
                                          cell[k] = xdmf_line(first + from + k);
                                      }));
  arrays.push_back(made<Real>("xdmf/contact_force", contact, 1, [&frame, dim](std::uint64_t from, std::span<Real> f) {
    for (std::size_t k = 0; k < f.size(); ++k) f[k] = norm(frame.contacts.force[from + k], dim);
  }));
}

}  // namespace pliant
