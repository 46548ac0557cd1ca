#include <pliant/domain/halo.h>

#include <petscsf.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <pliant/base/petsc.h>

namespace pliant {
namespace {

constexpr Real far = std::numeric_limits<Real>::max();

/// The smallest upright box around some points.
template <int D>
struct Bounds {
  Vec<D> low = Vec<D>::Constant(far), high = -low;

  void add(const Vec<D>& r) {
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  void add(const Bounds& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  bool meets(const Bounds& other, Real distance) const {
    return ((low - other.high).array() <= distance).all() && ((other.low - high).array() <= distance).all();
  }
  Bounds shifted(const Vec<D>& by) const {
    Bounds b = *this;
    b.low += by;
    b.high += by;
    return b;
  }
};

/// Bounds of a rank's particles in its home, of particles in the home up to box lengths, or of a particle that has left
/// the home. Plain data, to be sent.
template <int D>
struct Territory {
  std::array<Real, D> low, high;
  int rank;

  Territory() = default;
  Territory(const Bounds<D>& bounds, int of_rank) : rank(of_rank) {
    std::copy_n(bounds.low.data(), D, low.begin());
    std::copy_n(bounds.high.data(), D, high.begin());
  }
  Bounds<D> bounds() const {
    Bounds<D> b;
    std::copy_n(low.begin(), D, b.low.data());
    std::copy_n(high.begin(), D, b.high.data());
    return b;
  }
};

/// Data of a particle that the receiver needs besides its positions.
struct Ghost {
  Index id, points, first_point;
  Real diameter, sigma, a0, l0, mass, inertia;
  Image image;
};

/// −1, 0 or 1, the opposite for the opposite image.
int side_of(const Image& n) {
  const int below = n < Image{} ? 1 : 0, above = Image{} < n ? 1 : 0;
  return above - below;
}

template <int D>
Bounds<D> bounds_of(const Topology& topology, const Real* x, Index m) {
  Bounds<D> bounds;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) bounds.add(point<D>(x, i));
  return bounds;
}

/// Calls visit(n) for the images n of the content of `bounds` that come within the cutoff of `others`. From direction k
/// down to the first, because the tilt of an edge moves images along the directions before it; n and `by` hold the
/// numbers of edges in the directions beyond k, and the shift by these. Errors: NumericalError where there are very
/// many.
template <int D, int k = D - 1, class Visit>
void for_each_image(const Box<D>& box, const Bounds<D>& bounds, const Bounds<D>& others, Real reach, Image& n,
                    const Vec<D>& by, Visit&& visit) {
  if constexpr (k < 0) {
    visit(n);
  } else {
    constexpr Real most = 1000;
    const Real below = others.low[k] - (bounds.high[k] + by[k]), above = bounds.low[k] + by[k] - others.high[k];
    if (!box.periodic(k)) {
      if (below <= reach && above <= reach) for_each_image<D, k - 1>(box, bounds, others, reach, n, by, visit);
      return;
    }
    const Real from = std::ceil((below - reach) / box.length()[k]), to = std::floor((reach - above) / box.length()[k]);
    if (!(from <= to)) return;
    if (!(to - from < most))
      throw NumericalError(
          "what lies between {} and {} has more than {} images in reach; is the box of length {} right?", bounds.low[k],
          bounds.high[k], most, box.length()[k]);
    const Vec<D> edge = box.edge(k);
    const auto last = static_cast<std::int64_t>(to);
    for (auto m = static_cast<std::int64_t>(from); m <= last; ++m) {
      n[k] = m;
      for_each_image<D, k - 1>(box, bounds, others, reach, n, by + static_cast<Real>(m) * edge, visit);
    }
    n[k] = 0;
  }
}

}  // namespace

template <int D>
struct Halo<D>::Exchange {
  Handle<PetscSF, PetscSFDestroy> sf;
  MPI_Datatype point;  ///< D numbers

  Exchange() {
    MPI_Type_contiguous(D, MPIU_REAL, &point);
    MPI_Type_commit(&point);
  }
  ~Exchange() { MPI_Type_free(&point); }
  /// Data type of `width` numbers: a position or an angle.
  MPI_Datatype type(int width) const { return width == D ? point : MPIU_REAL; }
};

template <int D>
Halo<D>::Halo(Ranks ranks, const Box<D>& box) : ranks_(ranks), box_(box) {}

template <int D>
Halo<D>::~Halo() = default;
template <int D>
Halo<D>::Halo(Halo&&) noexcept = default;
template <int D>
Halo<D>& Halo<D>::operator=(Halo&&) noexcept = default;

template <int D>
void Halo<D>::set_home(const Topology& topology, const Real* x) {
  Bounds<D> home;
  if (ranks_.several() || box_.open()) {
    for (Index i = 0; i < topology.owned_points(); ++i) home.add(point<D>(x, i));
  } else {
    // The same whenever lists are built from the same positions, which a restart relies on.
    for (int k = 0; k < D; ++k) {
      home.low[k] = box_.periodic(k) ? box_.origin()[k] : -far;
      home.high[k] = box_.periodic(k) ? box_.origin()[k] + box_.length()[k] : far;
    }
  }
  // A little larger, so that a particle at the border does not leave the home by its first move.
  Real margin = 0;
  for (const Real d : topology.diameter) margin = std::max(margin, d);
  low_ = home.low.array() - margin;
  high_ = home.high.array() + margin;
}

template <int D>
Real Halo<D>::set_box(const Box<D>& box) {
  box_ = box;
  Real farthest = 0;
  for (Shifted& s : shifted_) {
    const Vec<D> by = box_.shift(s.image);
    farthest = std::max(farthest, (by - s.by).norm());
    s.by = by;
    s.velocity = box_.shift_velocity(s.image);
  }
  return farthest;
}

template <int D>
void Halo<D>::build(Topology& topology, const Real* x, Real margin) {
  topology.drop_ghosts();
  const Index n = topology.owned();
  widest_ = 0;
  for (const Real d : topology.diameter) widest_ = std::max(widest_, d);
  widest_ = ranks_.max(widest_);

  // Homes of all ranks.
  Bounds<D> home;
  home.low = low_;
  home.high = high_;
  std::vector<Bounds<D>> bounds(n);
  Bounds<D> at_home;
  std::map<Image, Bounds<D>> across;  // particles that are in the home after a shift by these lengths
  std::vector<Territory<D>> mine;
  bool any_at_home = false;
  for (Index m = 0; m < n; ++m) {
    const Bounds<D>& b = bounds[m] = bounds_of<D>(topology, x, m);
    if (home.meets(b, 0)) {
      at_home.add(b);
      any_at_home = true;
    } else if (const Image image = box_.image_of((b.low + b.high) / 2);
               image != Image{} && home.meets(b.shifted(-box_.shift(image)), 0)) {
      across[image].add(b);
    } else {
      mine.emplace_back(b, ranks_.rank());
    }
  }
  for (const auto& [image, b] : across) mine.emplace_back(b, ranks_.rank());
  strays_ = static_cast<Index>(mine.size());
  if (any_at_home) mine.emplace_back(at_home, ranks_.rank());
  const std::vector<Territory<D>> all = ranks_.all_gather(mine);

  // For each rank, the particles of this rank that it needs.
  std::vector<std::vector<Ghost>> parts(ranks_.size());
  const auto find = [&] {
    std::vector<Image> found;  // for a rank, whose territories follow each other
    for (Index m = 0; m < n; ++m) {
      if (topology.active[m] == 0) continue;
      const Index begin = topology.offset[m];
      const Real reach = (topology.diameter[begin] + widest_) / 2 + margin;
      int last_rank = -1;
      for (const Territory<D>& t : all) {
        if (t.rank != last_rank) found.clear();
        last_rank = t.rank;
        if (box_.open() && (t.rank == ranks_.rank() || !found.empty())) continue;
        Image edges{};
        for_each_image<D>(box_, bounds[m], t.bounds(), reach, edges, Vec<D>::Zero(), [&](const Image& image) {
          if (t.rank == ranks_.rank() && image == Image{}) return;
          if (std::find(found.begin(), found.end(), image) != found.end()) return;
          found.push_back(image);
          parts[t.rank].push_back({topology.id[m], topology.points_of(m), begin, topology.diameter[begin],
                                   topology.sigma[m], topology.a0[m], topology.l0[m],
                                   topology.point_mass[m] * topology.points_of(m), topology.inertia[m], image});
        });
      }
    }
  };
  if (box_.open())
    find();
  else
    ranks_.together(find);
  std::vector<int> received;
  const std::vector<Ghost> ghosts = ranks_.exchange(parts, &received);

  own_ = static_cast<std::size_t>(topology.points());
  copies_.clear();
  shifted_.clear();
  std::vector<PetscSFNode> roots;
  std::size_t next = 0;
  for (int r = 0; r < ranks_.size(); ++r)
    for (int k = 0; k < received[r]; ++k) {
      const Ghost& g = ghosts[next++];
      const auto first = static_cast<std::size_t>(topology.points()), count = static_cast<std::size_t>(g.points);
      topology.add_ghost(g.id, g.points, g.diameter, g.sigma, g.a0, g.l0, g.mass, g.inertia, side_of(g.image));
      if (ranks_.several())
        for (Index i = 0; i < g.points; ++i) roots.push_back({r, g.first_point + i});
      else
        copies_.push_back({static_cast<std::size_t>(g.first_point), first, count});
      if (g.image != Image{})
        shifted_.push_back({first, first + count, g.image, box_.shift(g.image), box_.shift_velocity(g.image)});
    }
  all_ = static_cast<std::size_t>(topology.points());
  if (!ranks_.several()) return;

  if (!exchange_) exchange_ = std::make_unique<Exchange>();
  petsc_check(PetscSFCreate(ranks_.comm(), exchange_->sf.out()));
  petsc_check(PetscSFSetGraph(exchange_->sf, static_cast<PetscInt>(own_), static_cast<PetscInt>(roots.size()), nullptr,
                              PETSC_COPY_VALUES, roots.data(), PETSC_COPY_VALUES));
  petsc_check(PetscSFSetUp(exchange_->sf));
}

template <int D>
void Halo<D>::update(const Real* own, std::vector<Real>& local) const {
  local.assign(own, own + own_ * D);
  begin(local);
  end(local);
}

template <int D>
void Halo<D>::update_positions(const Real* x, std::vector<Real>& local) const {
  update(x, local);
  shift_images(local);
}

template <int D>
void Halo<D>::update_velocities(const Real* v, std::vector<Real>& local) const {
  update(v, local);
  shift_velocities(local);
}

template <int D>
void Halo<D>::update_rotations(const Real* own, std::vector<Real>& local) const {
  local.assign(own, own + own_ * rotations<D>);
  begin(local, rotations<D>);
  end(local, rotations<D>);
}

template <int D>
void Halo<D>::update(std::vector<Real>& x, std::vector<Real>& v) const {
  begin(x);
  begin(v);
  end(x);
  end(v);
  shift_images(x);
  shift_velocities(v);
}

template <int D>
void Halo<D>::begin(std::vector<Real>& local, int width) const {
  const auto w = static_cast<std::size_t>(width);
  local.resize(all_ * w);
  if (!exchange_) {
    for (const Copy& c : copies_) std::copy_n(&local[c.from * w], c.count * w, &local[c.to * w]);
    return;
  }
  petsc_check(
      PetscSFBcastBegin(exchange_->sf, exchange_->type(width), local.data(), local.data() + own_ * w, MPI_REPLACE));
}

template <int D>
void Halo<D>::end(std::vector<Real>& local, int width) const {
  if (!exchange_) return;
  petsc_check(PetscSFBcastEnd(exchange_->sf, exchange_->type(width), local.data(),
                              local.data() + own_ * static_cast<std::size_t>(width), MPI_REPLACE));
}

template <int D>
void Halo<D>::shift_images(std::vector<Real>& x) const {
  for (const Shifted& s : shifted_)
    for (std::size_t i = s.first; i < s.last; ++i) point<D>(x.data(), static_cast<Index>(i)) += s.by;
}

template <int D>
void Halo<D>::shift_velocities(std::vector<Real>& v) const {
  if (!box_.flow().flows()) return;
  for (const Shifted& s : shifted_)
    for (std::size_t i = s.first; i < s.last; ++i) point<D>(v.data(), static_cast<Index>(i)) += s.velocity;
}

template class Halo<2>;
template class Halo<3>;

}  // namespace pliant
