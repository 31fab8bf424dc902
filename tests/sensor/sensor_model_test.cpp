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

TEST(SensorModel, RefusesNumbersWithoutSense) {
  for (double SensorModel::*number :
       {&SensorModel::depth_floor_m, &SensorModel::depth_slope, &SensorModel::depth_square,
        &SensorModel::sigmas, &SensorModel::delay_s, &SensorModel::readout_s,
        &SensorModel::min_range_m, &SensorModel::max_range_m})
    for (const double bad : {-1.0, std::nan(""), HUGE_VAL}) {
      SensorModel model;
      model.*number = bad;
      EXPECT_THROW(model.check(), Error);
    }
}

}  // namespace
