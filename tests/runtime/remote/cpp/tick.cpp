// Ticks the condition node of the guide once for each line of the standard input, and prints its status.

#include <context_is.hpp>
#include <iostream>

int main(int, char** arguments) {
  const auto context = std::make_shared<codra::Client>(arguments[1]);
  BT::BehaviorTreeFactory factory;
  register_nodes(factory, context);
  try {
    factory.instantiateTreeNode("misspelt", "ContextIs", {{{"variable", "door_opn"}}});
  } catch (const codra::Error& error) {
    std::cout << error.kind() << std::endl;
  }
  const auto node = factory.instantiateTreeNode("open", "ContextIs", {{{"variable", arguments[2]}}});
  const auto optimist =
      factory.instantiateTreeNode("open", "ContextIs", {{{"variable", arguments[2]}, {"unknown", "SUCCESS"}}});
  for (std::string line; std::getline(std::cin, line);) {
    for (BT::TreeNode* ticked : {node.get(), optimist.get()}) {
      std::cout << (ticked->executeTick() == BT::NodeStatus::SUCCESS ? "SUCCESS " : "FAILURE ");
    }
    std::cout << std::endl;
  }
}
