// Stub: whether the class could be made through the base class.
#pragma once

#include <memory>

#define PLUGINLIB_EXPORT_CLASS(derived, base) \
  std::unique_ptr<base> make_plugin();        \
  std::unique_ptr<base> make_plugin() { return std::make_unique<derived>(); }
