// SPDX-License-Identifier: BSD-2-Clause
//
// Plays a folder in TUM layout as a camera's topics, like a bag that loops, and checks every mask
// that the node answers: same stamp, same bytes as the front end gives without ROS. Prints latency,
// and CPU time and memory of the node's process. Images go through image_transport, so the node may
// subscribe to compressed ones; ROS parameters say how (color.image.compressed.format: png).
//
// Usage: soak SEQUENCE MASKS [options]
//   --frames N   frames to play (default 10000)
//   --rate HZ    default 30; 0: the next frame is sent when the mask of the last one has come
//   --length L   loop over the first L frames (default 100)
//   --pid PID    of the node
//   --expected DIR  the masks to compare with: stillpoint mask SEQUENCE --format dynamic --out DIR
//   --poses tf|odometry  tell the poses of groundtruth.txt, too; of a body, whose camera stands on
//   it
//   --play       only play
// Exit status 1: a mask differs, or with --rate 0 one is missing.

#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <image_transport/image_transport.hpp>
#include <iostream>
#include <map>
#include <rclcpp/rclcpp.hpp>
#include <string>
#include <tf2_msgs/msg/tf_message.hpp>
#include <thread>
#include <vector>

#include "recording.hpp"

namespace stillpoint_ros {

using namespace std::chrono_literals;
using nav_msgs::msg::Odometry;
using tf2_msgs::msg::TFMessage;
using Clock = std::chrono::steady_clock;

struct Options {
  std::string sequence, masks, expected, poses;
  int frames = 10000, length = 100;
  double rate = 30;
  int pid = 0;
  bool play = false;
};

// CPU seconds and resident megabytes of a process.
std::pair<double, double> usage(int pid) {
  const std::string folder = "/proc/" + std::to_string(pid) + "/";
  std::ifstream stat(folder + "stat"), memory(folder + "statm");
  std::string line;
  std::getline(stat, line);
  std::istringstream fields(line.substr(std::min(line.size(), line.rfind(')') + 2)));
  std::string skipped;
  double user = 0, system = 0, pages = 0, resident = 0;
  for (int i = 0; i < 11; ++i) fields >> skipped;
  fields >> user >> system;
  memory >> pages >> resident;
  return {(user + system) / static_cast<double>(sysconf(_SC_CLK_TCK)),
          resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6};
}

class Soak {
 public:
  explicit Soak(const Options& options)
      : options_(options),
        recording_(options.sequence, options.masks, static_cast<std::size_t>(options.length)),
        node_(std::make_shared<rclcpp::Node>("camera")) {
    const rclcpp::QoS qos(10);
    color_ =
        image_transport::create_publisher(node_.get(), "color/image", qos.get_rmw_qos_profile());
    depth_ =
        image_transport::create_publisher(node_.get(), "depth/image", qos.get_rmw_qos_profile());
    labels_ = node_->create_publisher<Image>("labels", qos);
    info_ = node_->create_publisher<CameraInfo>("color/camera_info", qos);
    tf_ = node_->create_publisher<TFMessage>("/tf", 100);
    fixed_tf_ = node_->create_publisher<TFMessage>("/tf_static", rclcpp::QoS(1).transient_local());
    odometry_ = node_->create_publisher<Odometry>("odometry", qos);
    TFMessage fixed;
    fixed.transforms = {transform_message(camera_on_body(), "base", "camera", 1)};
    if (!options.poses.empty()) fixed_tf_->publish(fixed);
    if (options.play) return;
    stillpoint::ros2::Parameters parameters;
    parameters.depth_units_per_m = recording_.camera().depth_units_per_m;
    parameters.exposure_s = recording_.camera().exposure_s;
    expected_ = options.expected.empty()
                    ? recording_.masks(parameters, !options.poses.empty())
                    : recording_.masks(std::filesystem::path(options.expected));
    mask_ = node_->create_subscription<Image>(
        "mask", rclcpp::QoS(50), [this](const Image::ConstSharedPtr& m) { check(*m); });
  }

  int run() {
    wait_for_node();
    const Clock::time_point start = Clock::now();
    const double cpu_s = usage(options_.pid).first;
    for (int i = 0; i < options_.frames && rclcpp::ok(); ++i) {
      send(static_cast<std::size_t>(i) % recording_.frames().size());
      if (options_.rate > 0)
        spin_until(start + std::chrono::duration_cast<Clock::duration>(
                               std::chrono::duration<double>((i + 1) / options_.rate)));
      else
        spin_until(Clock::now() + 5s, answered_ + 1);
      if (options_.pid && (i + 1) % std::max(1, options_.frames / 10) == 0)
        std::cout << i + 1 << " frames, " << answered_ << " masks, node "
                  << usage(options_.pid).second << " MB" << std::endl;
    }
    spin_until(Clock::now() + 1s);
    const double span_s = std::chrono::duration<double>(Clock::now() - start).count();
    return options_.play ? 0 : report(span_s, usage(options_.pid).first - cpu_s);
  }

 private:
  void wait_for_node() {
    while (rclcpp::ok() &&
           (color_.getNumSubscribers() == 0 || depth_.getNumSubscribers() == 0 ||
            labels_->get_subscription_count() == 0 || info_->get_subscription_count() == 0 ||
            (mask_ && mask_->get_publisher_count() == 0)))
      std::this_thread::sleep_for(50ms);
    info_->publish(to_message(recording_.camera(), recording_.frames().front().stamp));
    std::this_thread::sleep_for(1s);  // the calibration is there before the first image
  }

  void send(std::size_t i) {
    const Recording::Frame& frame = recording_.frames()[i];
    const bool wide = frame.images.depth.depth() == CV_32F;
    if (!options_.poses.empty() && frame.T_world_camera) send_pose(frame);
    if (frame.labels) labels_->publish(to_message(*frame.labels, "mono8", frame.stamp));
    info_->publish(to_message(recording_.camera(), frame.stamp));
    depth_.publish(to_message(frame.images.depth, wide ? "32FC1" : "16UC1",
                              stillpoint::ros2::nanoseconds(frame.images.depth_time())));
    sent_[frame.stamp] = {i, Clock::now()};
    color_.publish(to_message(frame.images.color, "bgr8", frame.stamp));
  }

  // A little before the image, as the odometry of wheels.
  void send_pose(const Recording::Frame& frame) {
    const Eigen::Isometry3d T = *frame.T_world_camera * camera_on_body().inverse();
    TFMessage moving;
    moving.transforms = {transform_message(T, "odom", "base", frame.stamp)};
    if (options_.poses == "tf") tf_->publish(moving);
    if (options_.poses == "odometry") odometry_->publish(odometry_message(T, frame.stamp));
    std::this_thread::sleep_for(5ms);
  }

  void spin_until(Clock::time_point end, int answers = 1 << 30) {
    while (rclcpp::ok() && Clock::now() < end && answered_ < answers) {
      rclcpp::spin_some(node_);
      std::this_thread::sleep_for(200us);
    }
  }

  void check(const Image& m) {
    const std::int64_t stamp = m.header.stamp.sec * INT64_C(1000000000) + m.header.stamp.nanosec;
    ++answered_;
    const auto it = sent_.find(stamp);
    if (it == sent_.end()) {
      ++foreign_;
      return;
    }
    const auto& [i, time] = it->second;
    latency_ms_.push_back(std::chrono::duration<double, std::milli>(Clock::now() - time).count());
    const cv::Mat& expected = expected_[i];
    if (m.header.frame_id != "camera" || m.encoding != "mono8" ||
        m.data.size() != expected.total()) {
      ++different_;
    } else if (std::memcmp(m.data.data(), expected.data, m.data.size()) != 0) {
      ++different_;
      const cv::Mat mask(expected.size(), CV_8UC1, const_cast<std::uint8_t*>(m.data.data()));
      different_pixels_ += cv::countNonZero(mask != expected);
    }
    dynamic_pixels_ += cv::countNonZero(expected);
  }

  int report(double span_s, double cpu_s) {
    std::sort(latency_ms_.begin(), latency_ms_.end());
    const auto quantile = [&](double q) {
      return latency_ms_.empty() ? 0
                                 : latency_ms_[static_cast<std::size_t>(
                                       q * static_cast<double>(latency_ms_.size() - 1))];
    };
    std::cout << options_.frames << " frames in " << span_s << " s: " << answered_ << " masks, "
              << different_ << " differ (by "
              << 100 * different_pixels_ / std::max(1.0, dynamic_pixels_)
              << " % of the dynamic pixels), " << foreign_ << " of other stamps\n"
              << "latency ms: p50 " << quantile(0.5) << ", p95 " << quantile(0.95) << ", most "
              << quantile(1) << "\n";
    if (options_.pid)
      std::cout << "node: " << 100 * cpu_s / span_s << " % of a core, "
                << 1e3 * cpu_s / std::max(1, answered_) << " ms of CPU per mask, "
                << usage(options_.pid).second << " MB\n";
    return different_ + foreign_ > 0 || (options_.rate == 0 && answered_ != options_.frames);
  }

  Options options_;
  Recording recording_;
  std::vector<cv::Mat> expected_;
  rclcpp::Node::SharedPtr node_;
  image_transport::Publisher color_, depth_;
  rclcpp::Publisher<Image>::SharedPtr labels_;
  rclcpp::Publisher<TFMessage>::SharedPtr tf_, fixed_tf_;
  rclcpp::Publisher<Odometry>::SharedPtr odometry_;
  rclcpp::Publisher<CameraInfo>::SharedPtr info_;
  rclcpp::Subscription<Image>::SharedPtr mask_;
  std::map<std::int64_t, std::pair<std::size_t, Clock::time_point>> sent_;
  std::vector<double> latency_ms_;
  double different_pixels_ = 0, dynamic_pixels_ = 0;
  int answered_ = 0, different_ = 0, foreign_ = 0;
};

}  // namespace stillpoint_ros

int main(int argc, char** argv) try {
  const std::vector<std::string> words = rclcpp::init_and_remove_ros_arguments(argc, argv);
  stillpoint_ros::Options options;
  std::vector<std::string> files;
  for (std::size_t i = 1; i < words.size(); ++i) {
    const bool more = i + 1 < words.size();
    if (words[i] == "--play")
      options.play = true;
    else if (words[i] == "--expected" && more)
      options.expected = words[++i];
    else if (words[i] == "--poses" && more)
      options.poses = words[++i];
    else if (words[i] == "--frames" && more)
      options.frames = std::stoi(words[++i]);
    else if (words[i] == "--length" && more)
      options.length = std::stoi(words[++i]);
    else if (words[i] == "--rate" && more)
      options.rate = std::stod(words[++i]);
    else if (words[i] == "--pid" && more)
      options.pid = std::stoi(words[++i]);
    else
      files.push_back(words[i]);
  }
  if (files.size() != 2) {
    std::cerr << "usage: soak SEQUENCE MASKS [--frames N] [--rate HZ] [--length L] [--pid PID] "
                 "[--expected DIR] [--poses tf|odometry] [--play]\n";
    return 2;
  }
  options.sequence = files[0], options.masks = files[1];
  const int status = stillpoint_ros::Soak(options).run();
  rclcpp::shutdown();
  return status;
} catch (const std::exception& error) {
  std::cerr << error.what() << "\n";
  return 1;
}
