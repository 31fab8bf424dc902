// SPDX-License-Identifier: BSD-2-Clause
//
// The node in rclcpp's component container, as a process of its own, driven by its services as
// `ros2 component` does.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <ament_index_cpp/get_package_prefix.hpp>
#include <chrono>
#include <composition_interfaces/srv/list_nodes.hpp>
#include <composition_interfaces/srv/load_node.hpp>
#include <composition_interfaces/srv/unload_node.hpp>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <rclcpp/rclcpp.hpp>
#include <std_msgs/msg/string.hpp>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace std::chrono_literals;
using composition_interfaces::srv::ListNodes;
using composition_interfaces::srv::LoadNode;
using composition_interfaces::srv::UnloadNode;

// Starts component_container_mt, which finds our components although they are not installed.
class Container {
 public:
  Container()
      : folder_(std::filesystem::temp_directory_path() / ("still_" + std::to_string(getpid()))) {
    const auto index = folder_ / "share/ament_index/resource_index/rclcpp_components";
    std::filesystem::create_directories(index);
    std::ofstream(index / "stillpoint_ros") << "stillpoint_ros::MaskNode;" << MASK_NODE
                                            << "\nstillpoint_ros::Camera;" << CAMERA << "\n";
    const std::string program = ament_index_cpp::get_package_prefix("rclcpp_components") +
                                "/lib/rclcpp_components/component_container_mt";
    const char* const others = std::getenv("AMENT_PREFIX_PATH");
    const std::string path = folder_.string() + ":" + (others ? others : "");
    pid_ = fork();
    if (pid_ != 0) return;
    setenv("AMENT_PREFIX_PATH", path.c_str(), 1);
    execl(program.c_str(), program.c_str(), "--ros-args", "-r", "__node:=container", nullptr);
    _exit(127);
  }
  ~Container() {
    if (pid_ > 0) kill(pid_, SIGKILL), waitpid(pid_, nullptr, 0);
    std::filesystem::remove_all(folder_);
  }
  // Asks it to end; its exit status.
  int end() {
    int status = 0;
    kill(pid_, SIGINT);
    waitpid(pid_, &status, 0);
    pid_ = 0;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  std::filesystem::path folder_;
  pid_t pid_ = 0;
};

class Client {
 public:
  Client() : node_(std::make_shared<rclcpp::Node>("client")) {
    verdicts_ = node_->create_subscription<std_msgs::msg::String>(
        "/verdict", 10, [this](std_msgs::msg::String::ConstSharedPtr m) { verdict_ = m->data; });
  }

  template <class Service>
  typename Service::Response::SharedPtr call(const std::string& name,
                                             typename Service::Request::SharedPtr request) {
    const auto client = node_->create_client<Service>("/container/_container/" + name);
    if (!client->wait_for_service(30s)) return nullptr;
    auto future = client->async_send_request(request);
    return rclcpp::spin_until_future_complete(node_, future, 30s) ==
                   rclcpp::FutureReturnCode::SUCCESS
               ? future.get()
               : nullptr;
  }

  // Loads a component; its number, 0 if that fails.
  std::uint64_t load(const std::string& plugin, const std::vector<rclcpp::Parameter>& parameters) {
    auto request = std::make_shared<LoadNode::Request>();
    request->package_name = "stillpoint_ros";
    request->plugin_name = plugin;
    request->node_namespace = "/robot";
    request->remap_rules = {"color/image:=/driver/color", "depth/image:=/driver/depth",
                            "color/camera_info:=/driver/info"};
    for (const rclcpp::Parameter& p : parameters)
      request->parameters.push_back(p.to_parameter_msg());
    request->extra_arguments.push_back(
        rclcpp::Parameter("use_intra_process_comms", true).to_parameter_msg());
    const auto answer = call<LoadNode>("load_node", request);
    if (answer && !answer->success) ADD_FAILURE() << answer->error_message;
    return answer && answer->success ? answer->unique_id : 0;
  }

  std::string verdict() {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (verdict_.empty() && std::chrono::steady_clock::now() < end) {
      rclcpp::spin_some(node_);
      std::this_thread::sleep_for(10ms);
    }
    return verdict_;
  }

 private:
  rclcpp::Node::SharedPtr node_;
  rclcpp::SubscriptionBase::SharedPtr verdicts_;
  std::string verdict_;
};

TEST(MaskNodeInAContainer, GivesTheFrontEndsMasksWithoutCopies) {
  Container container;
  Client client;
  const std::uint64_t id =
      client.load("stillpoint_ros::MaskNode",
                  {rclcpp::Parameter("mask_wait_s", 0.3), rclcpp::Parameter("poses", "tf")});
  ASSERT_GT(id, 0u);
  ASSERT_GT(client.load("stillpoint_ros::Camera", {}), 0u);
  EXPECT_EQ(client.verdict(), "20 masks, 0 wrong, readers without a copy: 2, same bytes: 20");

  auto list = client.call<ListNodes>("list_nodes", std::make_shared<ListNodes::Request>());
  ASSERT_TRUE(list);
  EXPECT_EQ(list->full_node_names,
            (std::vector<std::string>{"/robot/stillpoint", "/robot/camera"}));
  auto unload = std::make_shared<UnloadNode::Request>();
  unload->unique_id = id;
  const auto unloaded = client.call<UnloadNode>("unload_node", unload);
  ASSERT_TRUE(unloaded);
  EXPECT_TRUE(unloaded->success) << unloaded->error_message;
  list = client.call<ListNodes>("list_nodes", std::make_shared<ListNodes::Request>());
  ASSERT_TRUE(list);
  EXPECT_EQ(list->full_node_names, std::vector<std::string>{"/robot/camera"});
  EXPECT_EQ(container.end(), 0);
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  rclcpp::init(argc, argv);
  const int status = RUN_ALL_TESTS();
  rclcpp::shutdown();
  return status;
}
