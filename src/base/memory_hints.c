/* Hints about memory, for which Fortran has no words. They change nothing but the time that a run takes. */
#include <stdint.h>
#include <stdlib.h>
#ifdef __linux__
#include <sys/mman.h>
#endif

void prefetch_line(const void *address) { __builtin_prefetch(address); }

/* Large arrays begin with a cache line, so that each record of the size of a line lies on one only. Larger ones lie on
   huge pages, if the system has some to spare: the processor knows by heart where few pages are, but not hundreds of
   thousands. The linker leads all that asks for memory here (--wrap=malloc), as `allocate` has no words for that. */
void *__real_malloc(size_t bytes);
__attribute__((used)) void *__wrap_malloc(size_t bytes)
{
    const size_t line = 64, large = 128*1024, page = 2*1024*1024;
    void *memory;
    if (bytes < large) return __real_malloc(bytes);
    if (posix_memalign(&memory, bytes < page ? line : page, bytes)) return NULL;
#ifdef MADV_HUGEPAGE
    if (bytes >= page) madvise(memory, bytes / page * page, MADV_HUGEPAGE);
#endif
    return memory;
}
