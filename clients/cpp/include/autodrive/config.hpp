/// \file
/// Selects header-only or compiled use. The CMake target autodrive::compiled defines AUTODRIVE_COMPILED and links the
/// static library with the functions that compile slowly.
#pragma once

#ifdef AUTODRIVE_COMPILED
#define AUTODRIVE_INLINE
#else
/// Prefix of functions that are defined in impl/.
#define AUTODRIVE_INLINE inline
#endif
