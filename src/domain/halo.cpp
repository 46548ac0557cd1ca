#include <pliant/domain/halo.h>

#include <petscsf.h>

#include <limits>

#include <pliant/base/petsc.h>

namespace pliant {
namespace {

template <int D>
struct Box {
  Vec<D> low = Vec<D>::Constant(std::numeric_limits<Real>::max()), high = -low;

  void add(const Vec<D>& r) {
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  void add(const Box& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
  }
  bool meets(const Box& other, Real distance) const {
    return ((low - other.high).array() <= distance).all() && ((other.low - high).array() <= distance).all();
  }
};

/// Box of a rank's particles at home, or of one that has left home. Plain data, to be sent.
template <int D>
struct Territory {
  std::array<Real, D> low, high;
  int rank;
};

/// What another rank must know of a particle beside its positions.
struct Ghost {
  Index id, points, first_point;
  Real diameter, sigma, a0, l0;
};

template <int D>
Box<D> box_of(const Topology& topology, const Real* x, Index m) {
  Box<D> box;
  for (Index i = topology.offset[m]; i < topology.offset[m + 1]; ++i) box.add(point<D>(x, i));
  return box;
}

template <int D>
Territory<D> territory(const Box<D>& box, int rank) {
  Territory<D> t;
  std::copy_n(box.low.data(), D, t.low.begin());
  std::copy_n(box.high.data(), D, t.high.begin());
  t.rank = rank;
  return t;
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
};

template <int D>
Halo<D>::Halo(Ranks ranks) : ranks_(ranks) {}

template <int D>
Halo<D>::~Halo() = default;
template <int D>
Halo<D>::Halo(Halo&&) noexcept = default;
template <int D>
Halo<D>& Halo<D>::operator=(Halo&&) noexcept = default;

template <int D>
void Halo<D>::set_home(const Topology& topology, const Real* x) {
  Box<D> box;
  for (Index i = 0; i < topology.owned_points(); ++i) box.add(point<D>(x, i));
  // A little more: who sits at the border has not left home by its first move.
  Real margin = 0;
  for (const Real d : topology.diameter) margin = std::max(margin, d);
  low_ = box.low.array() - margin;
  high_ = box.high.array() + margin;
}

template <int D>
void Halo<D>::build(Topology& topology, const Real* x, Real margin) {
  topology.drop_ghosts();
  const Index n = topology.owned();
  Real widest = 0;
  for (const Real d : topology.diameter) widest = std::max(widest, d);
  widest = ranks_.max(widest);

  // Who is where.
  Box<D> home;
  home.low = low_;
  home.high = high_;
  std::vector<Box<D>> boxes(n);
  Box<D> at_home;
  std::vector<Territory<D>> mine;
  strays_ = 0;
  for (Index m = 0; m < n; ++m) {
    boxes[m] = box_of<D>(topology, x, m);
    if (home.meets(boxes[m], 0)) {
      at_home.add(boxes[m]);
    } else {
      mine.push_back(territory<D>(boxes[m], ranks_.rank()));
      ++strays_;
    }
  }
  if (strays_ < n) mine.push_back(territory<D>(at_home, ranks_.rank()));
  const std::vector<Territory<D>> all = ranks_.all_gather(mine);

  // Who needs which of mine.
  std::vector<std::vector<Ghost>> parts(ranks_.size());
  for (Index m = 0; m < n; ++m) {
    if (topology.active[m] == 0) continue;
    const Index first = topology.offset[m];
    const Real reach = (topology.diameter[first] + widest) / 2 + margin;
    int last_rank = -1;  // the territories of a rank follow each other
    for (const Territory<D>& t : all) {
      if (t.rank == ranks_.rank() || t.rank == last_rank) continue;
      Box<D> box;
      std::copy_n(t.low.begin(), D, box.low.data());
      std::copy_n(t.high.begin(), D, box.high.data());
      if (!box.meets(boxes[m], reach)) continue;
      last_rank = t.rank;
      parts[t.rank].push_back({topology.id[m], topology.points_of(m), first, topology.diameter[first],
                               topology.sigma[m], topology.a0[m], topology.l0[m]});
    }
  }
  std::vector<int> received;
  const std::vector<Ghost> ghosts = ranks_.exchange(parts, &received);

  own_ = static_cast<std::size_t>(topology.points());
  std::vector<PetscSFNode> roots;
  std::size_t next = 0;
  for (int r = 0; r < ranks_.size(); ++r)
    for (int k = 0; k < received[r]; ++k) {
      const Ghost& g = ghosts[next++];
      topology.add_ghost(g.id, g.points, g.diameter, g.sigma, g.a0, g.l0);
      for (Index i = 0; i < g.points; ++i) roots.push_back({r, g.first_point + i});
    }
  all_ = static_cast<std::size_t>(topology.points());

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
void Halo<D>::update(std::vector<Real>& local, std::vector<Real>& other) const {
  begin(local);
  begin(other);
  end(local);
  end(other);
}

template <int D>
void Halo<D>::begin(std::vector<Real>& local) const {
  local.resize(all_ * D);
  petsc_check(PetscSFBcastBegin(exchange_->sf, exchange_->point, local.data(), local.data() + own_ * D, MPI_REPLACE));
}

template <int D>
void Halo<D>::end(std::vector<Real>& local) const {
  petsc_check(PetscSFBcastEnd(exchange_->sf, exchange_->point, local.data(), local.data() + own_ * D, MPI_REPLACE));
}

template class Halo<2>;
template class Halo<3>;

}  // namespace pliant
