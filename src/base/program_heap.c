/* Fixes the size above which the C library allocates an array in a memory mapping of its own instead of on the heap. By
   default the C library increases this size during a run. Large arrays allocated again and again would then fragment
   the heap, and the memory use of a long run would grow without limit. The file is linked into the program but not into
   the shared libraries, whose heap belongs to the program that loads them. */
#if defined(MEMORY_HINTS) && defined(__linux__)
#include <malloc.h>
#ifdef M_MMAP_THRESHOLD
enum { large = 128*1024 }; /* as in memory_hints.c */

__attribute__((constructor, used)) static void map_large_arrays(void)
{
    mallopt(M_MMAP_THRESHOLD, large);
}
#endif
#endif

typedef int not_empty; /* ISO C forbids an empty file */
