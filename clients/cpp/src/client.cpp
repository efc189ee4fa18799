// What client.hpp leaves to a library.
#include <autodrive/impl/client.ipp>
