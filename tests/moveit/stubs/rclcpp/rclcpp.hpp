// Stub: parameters and a log that prints errors.
#pragma once

#include <cstdio>
#include <map>
#include <memory>
#include <string>

namespace rclcpp {

class Logger {};

inline Logger get_logger(const std::string&) { return {}; }

class Parameter {
 public:
  explicit Parameter(std::string value) : value_(std::move(value)) {}
  std::string as_string() const { return value_; }

 private:
  std::string value_;
};

class Node {
 public:
  using SharedPtr = std::shared_ptr<Node>;
  bool has_parameter(const std::string& name) const { return values.count(name) > 0; }
  template <typename T>
  void declare_parameter(const std::string& name, const T& value) {
    values[name] = value;
  }
  Parameter get_parameter(const std::string& name) const { return Parameter(values.at(name)); }

  std::map<std::string, std::string> values;
};

}  // namespace rclcpp

#define RCLCPP_ERROR(logger, ...) ((void)(logger), std::fprintf(stderr, __VA_ARGS__), std::fprintf(stderr, "\n"))
