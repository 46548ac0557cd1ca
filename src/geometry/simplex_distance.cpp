#include <pliant/geometry/simplex_distance.h>

#include <Eigen/LU>

namespace pliant {

PlaceMotion::PlaceMotion(const FourPoints& r, int first, const NearestPlaces& places) : places_(places) {
  // Each coordinate moves weight from the first point that carries a place to another one.
  std::array<Vec<3>, 2> g;
  for (const auto& [begin, end, sign] : {std::array{0, first, 1}, std::array{first, 4, -1}}) {
    int from = -1;
    for (int k = begin; k < end; ++k) {
      if (places.weight[k] == 0) continue;
      if (from < 0) {
        from = k;
        continue;
      }
      weight_[count_][k] = sign;
      weight_[count_][from] = -sign;
      g[count_++] = sign * (r[k] - r[from]);
    }
  }
  Mat<2> metric = Mat<2>::Identity();
  for (int i = 0; i < count_; ++i)
    for (int j = 0; j < count_; ++j) metric(i, j) = g[i].dot(g[j]);
  const Mat<2> inverse = metric.inverse();
  for (int k = 0; k < 4; ++k) {
    for (int i = 0; i < count_; ++i) mixed_[i][k] = weight_[i][k] * places.offset + places.weight[k] * g[i];
    for (int i = 0; i < count_; ++i) {
      by_point_[i][k].setZero();
      for (int j = 0; j < count_; ++j) by_point_[i][k] -= inverse(i, j) * mixed_[j][k];
    }
  }
}

Mat<3> PlaceMotion::hessian(int k, int l) const {
  if (!(places_.d2 > 0)) return Mat<3>::Zero();
  Mat<3> sum = places_.weight[k] * places_.weight[l] *
               (Mat<3>::Identity() - places_.offset * places_.offset.transpose() / places_.d2);
  for (int i = 0; i < count_; ++i) sum += mixed_[i][k] * by_point_[i][l].transpose();
  return sum / std::sqrt(places_.d2);
}

}  // namespace pliant
