// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/segmentation/line_predictor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace {

using stillpoint::predict_on_line;
using stillpoint::TimedPoint;

cv::Point2d predict(const std::vector<TimedPoint>& places, double timestamp) {
  return predict_on_line(places.data(), places.size(), timestamp);
}

// The paper's formula as printed, in the precision of T.
template <class T>
cv::Point2d as_printed(const std::vector<TimedPoint>& places, double timestamp) {
  T n = static_cast<T>(places.size()), x = 0, y = 0, t = 0, tt = 0, xt = 0, yt = 0;
  for (const TimedPoint& q : places) {
    const T s = static_cast<T>(q.timestamp);
    x += q.x, y += q.y, t += s, tt += s * s, xt += q.x * s, yt += q.y * s;
  }
  const T k1 = (n * xt - x * t) / (n * tt - t * t), b1 = (x - k1 * t) / n;
  const T k2 = (n * yt - y * t) / (n * tt - t * t), b2 = (y - k2 * t) / n;
  const T at = static_cast<T>(timestamp);
  return {static_cast<double>(k1 * at + b1), static_cast<double>(k2 * at + b2)};
}

TEST(LinePredictor, IsThePapersFormula) {
  const std::vector<TimedPoint> places{{100, 50, 0.0}, {109, 47, 0.1}, {113, 49, 0.23}};
  for (const double t : {0.23, 0.3, 1.0}) {
    const cv::Point2d expected = as_printed<double>(places, t), found = predict(places, t);
    EXPECT_NEAR(found.x, expected.x, 1e-9);
    EXPECT_NEAR(found.y, expected.y, 1e-9);
  }
}

TEST(LinePredictor, KeepsItsDigitsAtUnixTime) {
  const double origin = 1341846313.592026;
  const std::vector<TimedPoint> early{{100, 50, 0.0}, {109, 47, 0.033}, {113, 49, 0.067}};
  std::vector<TimedPoint> late = early;
  for (TimedPoint& q : late) q.timestamp += origin;
  const cv::Point2d expected = predict(early, 0.1), found = predict(late, origin + 0.1);
  EXPECT_NEAR(found.x, expected.x, 1e-3);  // a double holds 0.2 microseconds there
  EXPECT_NEAR(found.y, expected.y, 1e-3);
  // What the shift is for: as printed, nothing is left.
  const cv::Point2d printed = as_printed<double>(late, origin + 0.1);
  EXPECT_FALSE(std::abs(printed.x - expected.x) < 0.5);
}

TEST(LinePredictor, GoesByTimeNotByFrames) {
  // 90 px/s and -30 px/s, frames dropped.
  const double origin = 1.3e9;
  std::vector<TimedPoint> places;
  for (const double t : {0.0, 0.033, 0.1, 0.133, 0.4})
    places.push_back({20 + 90 * t, 200 - 30 * t, origin + t});
  const cv::Point2d found = predict(places, origin + 0.9);
  EXPECT_NEAR(found.x, 101, 1e-3);
  EXPECT_NEAR(found.y, 173, 1e-3);
}

TEST(LinePredictor, OnePlaceStaysWhereItIs) {
  const cv::Point2d found = predict({{12.5, -3, 1.3e9}}, 1.3e9 + 5);
  EXPECT_EQ(found, cv::Point2d(12.5, -3));
}

TEST(LinePredictor, TwoPlacesGiveTheirLine) {
  const cv::Point2d found = predict({{10, 20, 5.0}, {14, 18, 5.5}}, 6.5);
  EXPECT_NEAR(found.x, 22, 1e-12);
  EXPECT_NEAR(found.y, 14, 1e-12);
}

TEST(LinePredictor, EqualTimesGiveTheMean) {
  const cv::Point2d found = predict({{10, 20, 7}, {20, 30, 7}, {60, 10, 7}}, 8);
  EXPECT_NEAR(found.x, 30, 1e-12);
  EXPECT_NEAR(found.y, 20, 1e-12);
}

TEST(LinePredictor, AveragesNoise) {
  std::vector<TimedPoint> places;
  for (int i = 0; i < 8; ++i) places.push_back({10.0 * i + (i % 2 ? 2 : -2), 5.0 * i, 0.1 * i});
  const cv::Point2d found = predict(places, 0.8);
  EXPECT_NEAR(found.x, 80, 1.5);
  EXPECT_NEAR(found.y, 40, 1e-9);
}

}  // namespace
