// What devkit.hpp leaves to a library.
#include <autodrive/impl/devkit.ipp>
#include <autodrive/impl/telemetry.ipp>
#include <autodrive/impl/text.ipp>
