/// \file
/// Header-only, or with what is slow to compile in a library: AUTODRIVE_COMPILED, which CMake's target
/// autodrive::compiled defines, says that the latter is linked.
#pragma once

#ifdef AUTODRIVE_COMPILED
#define AUTODRIVE_INLINE
#else
/// What stands before functions that are defined in impl/.
#define AUTODRIVE_INLINE inline
#endif
