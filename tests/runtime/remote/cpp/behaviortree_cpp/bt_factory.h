// The few declarations of BehaviorTree.CPP 4 that the node in docs/how-to/cpp.md uses, with the same signatures.
// Debian has no package of BehaviorTree.CPP, so the tests cannot use the library itself.

#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <utility>

namespace BT {

enum class NodeStatus { IDLE, RUNNING, SUCCESS, FAILURE, SKIPPED };

struct PortInfo {
  std::string default_text;
};

using PortsList = std::unordered_map<std::string, PortInfo>;

struct NodeConfig {
  std::unordered_map<std::string, std::string> input_ports;
};

template <typename T>
std::pair<std::string, PortInfo> InputPort(const std::string& name, const std::string& /*description*/) {
  return {name, {}};
}

template <typename T>
std::pair<std::string, PortInfo> InputPort(const std::string& name, const T& default_value,
                                           const std::string& /*description*/) {
  return {name, {default_value == NodeStatus::SUCCESS ? "SUCCESS" : "FAILURE"}};
}

class TreeNode {
 public:
  TreeNode(std::string, NodeConfig config) : config_(std::move(config)) {}
  virtual ~TreeNode() = default;
  NodeStatus executeTick() { return tick(); }

  template <typename T>
  std::optional<T> getInput(const std::string& key) const {
    const auto entry = config_.input_ports.find(key);
    if (entry == config_.input_ports.end()) return std::nullopt;
    if constexpr (std::is_same_v<T, NodeStatus>) {
      return entry->second == "SUCCESS" ? NodeStatus::SUCCESS : NodeStatus::FAILURE;
    } else {
      return entry->second;
    }
  }

 protected:
  virtual NodeStatus tick() = 0;

 private:
  NodeConfig config_;
};

class ConditionNode : public TreeNode {
 public:
  using TreeNode::TreeNode;
};

class BehaviorTreeFactory {
 public:
  template <typename T, typename... ExtraArgs>
  void registerNodeType(const std::string& ID, ExtraArgs... args) {
    builders_[ID] = [args...](const std::string& name, NodeConfig config) {
      for (const auto& [port, info] : T::providedPorts()) {
        if (!info.default_text.empty()) config.input_ports.emplace(port, info.default_text);
      }
      return std::make_unique<T>(name, config, args...);
    };
  }

  std::unique_ptr<TreeNode> instantiateTreeNode(const std::string& name, const std::string& ID,
                                                const NodeConfig& config) const {
    return builders_.at(ID)(name, config);
  }

 private:
  std::map<std::string, std::function<std::unique_ptr<TreeNode>(const std::string&, NodeConfig)>> builders_;
};

}  // namespace BT
