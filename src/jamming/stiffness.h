// Second derivatives of the energy of a packing, with respect to positions and strains.
#pragma once

#include <Eigen/SparseCore>
#include <span>
#include <utility>
#include <vector>

#include <pliant/base/petsc.h>
#include <pliant/system/particle_system.h>

namespace pliant {

/// The largest norm of a column.
Real largest_column(const Eigen::MatrixXd& matrix);

/// Derivatives of the energy U(x, e) where all particles and the box are strained, r → (1 + e) r, and the coordinates x
/// move them in addition. Strain e_ab is number a D + b.
template <int D>
struct StrainDerivatives {
  using Square = Eigen::Matrix<Real, D * D, D * D>;

  Eigen::MatrixXd mixed;  ///< [coordinates, D²] ∂²U/∂x∂e_ab, in the rows of Stiffness: the forces by a strain, with
                          ///< the opposite sign
  Square affine;  ///< ∂²U/∂e_ab∂e_cd at fixed x, where every point follows the strain
};

/// The Hessian ∂²U/∂x² of the active particles at one configuration, as a sparse matrix in rows of scalars (CSR). In a
/// periodic box images belong to the rows of their originals. Only pairs that touch have entries.
template <int D>
class Stiffness {
 public:
  using Csr = Eigen::SparseMatrix<Real, Eigen::RowMajor, PetscInt>;

  /// At x [size of the system], with or without pre-stress: without it each contact, edge, angle and area is at rest.
  /// Errors: InputError on several ranks, for terms without second derivatives, and for walls without pre-stress;
  /// MemoryError.
  Stiffness(ParticleSystem<D>& system, std::span<const Real> x, PreStress pre_stress = PreStress::kept);

  /// Number of rows: D for each point of an active particle.
  Index size() const { return static_cast<Index>(points_.size()) * D; }
  /// The own point of rows D k … D k + D − 1.
  const std::vector<Index>& points() const { return points_; }
  /// Both triangles.
  Eigen::Map<const Csr> matrix() const {
    return {size(), size(), start_.back(), start_.data(), column_.data(), values_.data()};
  }
  /// visit(i, j, block) for the blocks of rows D i … and columns D j … D j + D − 1.
  template <class Visit>
  void for_each_block(Visit&& visit) const {
    Mat<D> block;
    for (Index row = 0; row < size(); row += D) {
      const PetscInt first = start_[row], width = start_[row + 1] - first;
      for (PetscInt k = 0; k < width; k += D) {
        for (int a = 0; a < D; ++a)
          for (int b = 0; b < D; ++b) block(a, b) = values_[first + a * width + k + b];
        visit(row / D, column_[first + k] / D, std::as_const(block));
      }
    }
  }
  /// The same entries, which the stiffness owns, as a sequential AIJ matrix of PETSc. They may change in place.
  PetscMat petsc();
  /// S H S with the diagonal matrix S of these numbers [size()]. The derivatives by strains stay the same.
  void scale(const Eigen::VectorXd& factors);
  /// Upper bound of the absolute values of all eigenvalues: the largest sum of absolute values of a row.
  Real bound() const;
  const StrainDerivatives<D>& strain() const { return strain_; }

  /// A vector [size()] as displacements of all own points [own points · D], 0 for inactive particles.
  std::vector<Real> displacements(const Eigen::Ref<const Eigen::VectorXd>& rows) const;

 private:
  std::size_t own_points_;
  std::vector<Index> points_;
  std::vector<PetscInt> start_, column_;
  std::vector<Real> values_;
  StrainDerivatives<D> strain_;
};

extern template class Stiffness<2>;
extern template class Stiffness<3>;

}  // namespace pliant
