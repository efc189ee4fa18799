// Compiled part of client.hpp.
#include <autodrive/impl/client.ipp>
