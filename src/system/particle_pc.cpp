#include <pliant/system/particle_pc.h>

#include <petsc/private/pcimpl.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <memory>
#include <variant>
#include <vector>

namespace pliant {
namespace {

constexpr char key[] = "pliant_particle_blocks";

struct Blocks {
  bool first_order;
  std::vector<PetscInt> first;  ///< [particles + 1] coordinates
};

/// Factor of one particle: numbers p and q; R and S in T.
struct Factor {
  PetscScalar p = 0, q = 1;
  Eigen::MatrixXd s;  ///< first order only
  std::variant<Eigen::LLT<Eigen::MatrixXd>, Eigen::PartialPivLU<Eigen::MatrixXd>> t;

  Eigen::VectorXd solve(const Eigen::VectorXd& b) const {
    return std::visit([&](const auto& factors) { return Eigen::VectorXd(factors.solve(b)); }, t);
  }
};

struct ParticlePc {
  Blocks blocks;
  std::vector<Factor> factors;
};

ParticlePc& data_of(PC pc) { return *static_cast<ParticlePc*>(pc->data); }

PetscErrorCode delete_blocks(void* blocks) {
  delete static_cast<Blocks*>(blocks);
  return 0;
}

/// Calls visit(column, value) for the entries of a row of a rank's own part.
template <class Visit>
void for_each_in_row(::Mat matrix, PetscInt row, Visit&& visit) {
  PetscInt count = 0;
  const PetscInt* columns = nullptr;
  const PetscScalar* values = nullptr;
  petsc_check(MatGetRow(matrix, row, &count, &columns, &values));
  for (PetscInt k = 0; k < count; ++k) visit(columns[k], values[k]);
  petsc_check(MatRestoreRow(matrix, row, &count, &columns, &values));
}

Factor factor_of(::Mat matrix, bool first_order, PetscInt n, PetscInt first, PetscInt size) {
  Factor factor;
  Eigen::MatrixXd t = Eigen::MatrixXd::Zero(size, size);
  if (first_order) {
    factor.s = t;
    for_each_in_row(matrix, first, [&](PetscInt column, PetscScalar value) {
      if (column == first) factor.p = value;
      if (column == n + first) factor.q = value;
    });
  }
  for (PetscInt a = 0; a < size; ++a)
    for_each_in_row(matrix, (first_order ? n : 0) + first + a, [&](PetscInt column, PetscScalar value) {
      Eigen::MatrixXd& part = column < n ? t : factor.s;
      const PetscInt b = column % n - first;
      if (b >= 0 && b < size) part(a, b) = value;
    });
  if (first_order) t -= factor.p / factor.q * factor.s;
  // Friction makes it unsymmetric, a compressed particle indefinite.
  if ((t - t.transpose()).cwiseAbs().maxCoeff() <= 1e-12 * t.cwiseAbs().maxCoeff()) {
    factor.t = t.llt();
    if (std::get<0>(factor.t).info() == Eigen::Success) return factor;
  }
  factor.t = t.partialPivLu();
  return factor;
}

PetscErrorCode set_up(PC pc) {
  PetscObject object = nullptr;
  void* blocks = nullptr;
  ::Mat local = nullptr;
  PetscInt n = 0;

  PetscFunctionBegin;
  PetscCall(PetscObjectQuery(reinterpret_cast<PetscObject>(pc->pmat), key, &object));
  PetscCheck(object != nullptr, PetscObjectComm(reinterpret_cast<PetscObject>(pc)), PETSC_ERR_ARG_WRONGSTATE,
             "-pc_type particle: the matrix does not contain the rows of each particle; use another -pc_type");
  PetscCall(PetscContainerGetPointer(reinterpret_cast<PetscContainer>(object), &blocks));
  PetscCall(MatGetDiagonalBlock(pc->pmat, &local));
  PetscCall(MatGetLocalSize(pc->pmat, &n, nullptr));
  PetscCall(petsc_callback([&] {
    ParticlePc& d = data_of(pc);
    d.blocks = *static_cast<const Blocks*>(blocks);
    if (d.blocks.first_order) n /= 2;
    d.factors.clear();
    for (std::size_t m = 0; m + 1 < d.blocks.first.size(); ++m)
      d.factors.push_back(
          factor_of(local, d.blocks.first_order, n, d.blocks.first[m], d.blocks.first[m + 1] - d.blocks.first[m]));
  }));
  PetscFunctionReturn(0);
}

PetscErrorCode apply(PC pc, ::Vec in, ::Vec out) {
  const PetscScalar* b = nullptr;
  PetscScalar* y = nullptr;

  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(in, &b));
  PetscCall(VecGetArrayWrite(out, &y));
  const ParticlePc& d = data_of(pc);
  const PetscInt n = d.blocks.first.back();
  for (std::size_t m = 0; m < d.factors.size(); ++m) {
    const Factor& factor = d.factors[m];
    const PetscInt first = d.blocks.first[m], size = d.blocks.first[m + 1] - first;
    const auto part = [&](auto* values) { return Eigen::Map<Eigen::VectorXd>(values, size); };
    const Eigen::Map<const Eigen::VectorXd> f(b + first, size);
    Eigen::Map<Eigen::VectorXd> x = part(y + first);
    if (!d.blocks.first_order) {
      x = factor.solve(f);
      continue;
    }
    const Eigen::Map<const Eigen::VectorXd> g(b + n + first, size);
    x = factor.solve(g - factor.s * f / factor.q);
    part(y + n + first) = (f - factor.p * x) / factor.q;
  }
  PetscCall(VecRestoreArrayWrite(out, &y));
  PetscCall(VecRestoreArrayRead(in, &b));
  PetscFunctionReturn(0);
}

PetscErrorCode reset(PC pc) {
  PetscFunctionBegin;
  data_of(pc) = {};
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(PC pc) {
  PetscFunctionBegin;
  delete static_cast<ParticlePc*>(pc->data);
  pc->data = nullptr;
  PetscFunctionReturn(0);
}

PetscErrorCode view(PC pc, PetscViewer viewer) {
  PetscFunctionBegin;
  std::size_t cholesky = 0;
  for (const Factor& factor : data_of(pc).factors) cholesky += factor.t.index() == 0 ? 1 : 0;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  particles on the first rank: %zu by Cholesky, %zu by LU\n", cholesky,
                                   data_of(pc).factors.size() - cholesky));
  PetscFunctionReturn(0);
}

PetscErrorCode create(PC pc) {
  PetscFunctionBegin;
  pc->data = new ParticlePc;
  pc->ops->setup = set_up;
  pc->ops->apply = apply;
  pc->ops->reset = reset;
  pc->ops->destroy = destroy;
  pc->ops->view = view;
  PetscFunctionReturn(0);
}

}  // namespace

PetscErrorCode particle_pc_register() {
  PetscFunctionBegin;
  PetscCall(PCRegister(particle_pc, create));
  PetscFunctionReturn(0);
}

void set_particle_blocks(::Mat matrix, JacobianForm form, const Topology& topology, int dim) {
  auto blocks = std::make_unique<Blocks>(Blocks{form == JacobianForm::first_order, {}});
  for (Index m = 0; m <= topology.owned(); ++m) blocks->first.push_back(topology.offset[m] * dim);
  Handle<PetscContainer, PetscContainerDestroy> container;
  petsc_check(PetscContainerCreate(PetscObjectComm(reinterpret_cast<PetscObject>(matrix)), container.out()));
  petsc_check(PetscContainerSetPointer(container, blocks.release()));
  petsc_check(PetscContainerSetUserDestroy(container, delete_blocks));
  petsc_check(
      PetscObjectCompose(reinterpret_cast<PetscObject>(matrix), key, reinterpret_cast<PetscObject>(container.get())));
}

}  // namespace pliant
