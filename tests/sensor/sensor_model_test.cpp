// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/sensor/sensor_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using stillpoint::Error;
using stillpoint::SensorModel;

TEST(SensorModel, NoiseGrowsWithTheDistance) {
  for (const SensorModel& model : {SensorModel::kinect_v1(), SensorModel::time_of_flight(),
                                   SensorModel::realsense_d400(), SensorModel::exact()}) {
    EXPECT_NO_THROW(model.check());
    for (float z = 0.5f; z < 8; z += 0.5f) {
      EXPECT_GT(model.depth_sigma_m(z + 0.5f), model.depth_sigma_m(z));
      EXPECT_FLOAT_EQ(model.least_step_m(z), 4 * model.depth_sigma_m(z));
    }
  }
  // Khoshelham and Oude Elberink: 1.5 cm at random at 3.2 m; and as much that is systematic.
  EXPECT_NEAR(SensorModel::kinect_v1().depth_sigma_m(3.2f), 0.03f, 0.006f);
  EXPECT_LT(SensorModel::time_of_flight().depth_sigma_m(4),
            SensorModel::kinect_v1().depth_sigma_m(4));
}

TEST(SensorModel, TellsTheVarianceOfInverseDepths) {
  SensorModel model;
  for (double z = 0.5; z < 8; z += 0.5) {
    const double sigma = model.depth_sigma_m(static_cast<float>(z)) / (z * z);
    EXPECT_NEAR(model.inverse_depth_variance(1 / z), sigma * sigma, 1e-7);
  }
  model.depth_floor_m = model.depth_slope = model.depth_square = 0;
  EXPECT_GT(model.inverse_depth_variance(1), 0) << "a weight must be finite";
}

TEST(SensorModel, TrustsManyMeasurementsOfOnePlaceByTheirRandomPart) {
  SensorModel model;
  // The variance of a mean of n: random / n + systematic; each of n such weights 1 / repeated^2.
  for (const double systematic : {0.0, 0.3, 1.0})
    for (const std::size_t n : {1, 2, 10}) {
      model.depth_systematic = systematic;
      const double of_mean = (1 - systematic) / static_cast<double>(n) + systematic;
      EXPECT_NEAR(model.repeated(n) * model.repeated(n) / static_cast<double>(n), of_mean, 1e-12);
    }
  EXPECT_EQ(model.repeated(0), 1);
}

TEST(SensorModel, RefusesNumbersWithoutSense) {
  for (double SensorModel::*number :
       {&SensorModel::depth_floor_m, &SensorModel::depth_slope, &SensorModel::depth_square,
        &SensorModel::depth_systematic, &SensorModel::sigmas, &SensorModel::delay_s,
        &SensorModel::readout_s, &SensorModel::min_range_m, &SensorModel::max_range_m})
    for (const double bad : {-1.0, std::nan(""), HUGE_VAL}) {
      SensorModel model;
      model.*number = bad;
      EXPECT_THROW(model.check(), Error);
    }
  SensorModel model;
  model.depth_systematic = 1.1;
  EXPECT_THROW(model.check(), Error);
}

}  // namespace
