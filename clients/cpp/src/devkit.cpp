// Compiled part of devkit.hpp.
#include <autodrive/impl/devkit.ipp>
#include <autodrive/impl/telemetry.ipp>
#include <autodrive/impl/text.ipp>
