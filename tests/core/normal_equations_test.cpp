// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/normal_equations.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace stillpoint {
namespace {

using Matrix4 = Eigen::Matrix<double, 4, 4>;
using Vector4 = Eigen::Matrix<double, 4, 1>;

// Symmetric and positive definite.
Matrix4 information() {
  Matrix4 J;
  J << 2, 1, 0, 3, -1, 4, 2, 0, 0, 1, 5, -2, 3, 0, 1, 1;
  return J.transpose() * J + 0.1 * Matrix4::Identity();
}

TEST(NormalEquations, SolvesByTheLowerHalf) {
  const Matrix4 H = information();
  const Vector4 x(0.5, -2, 3, 1);
  Matrix4 lower = H.triangularView<Eigen::Lower>();
  const auto solved = detail::solve_normal_equations<4>(lower, H * x);
  ASSERT_TRUE(solved);
  EXPECT_LT((*solved - x).norm(), 1e-9);
}

TEST(NormalEquations, RefusesWhatHasNoSolution) {
  Matrix4 flat = information();
  flat.row(3).setZero();
  flat.col(3).setZero();  // nothing is known of the last unknown
  EXPECT_FALSE(detail::solve_normal_equations<4>(flat, Vector4(1, 1, 1, 1)));
  Matrix4 broken = information();
  broken(2, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(detail::solve_normal_equations<4>(broken, Vector4(1, 1, 1, 1)));
  Vector4 right(1, std::numeric_limits<double>::infinity(), 1, 1);
  EXPECT_FALSE(detail::solve_normal_equations<4>(information(), right));
}

}  // namespace
}  // namespace stillpoint
