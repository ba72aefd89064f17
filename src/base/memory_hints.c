/* Hints about memory that Fortran cannot express. They change nothing but the time that a run takes. Everything here
   depends on the compiler, the linker and the system; without MEMORY_HINTS (see HINTS in the Makefile) nothing is left. */
#include <stdint.h>

#ifdef MEMORY_HINTS
#include <stdlib.h>
#ifdef __linux__
#include <sys/mman.h>
#endif

#define PREFETCH(address) __builtin_prefetch(address)

/* Large arrays start on a cache line, so that a record as long as a line lies in one. Larger ones lie on huge pages, if
   the system has any to spare: the TLB covers few pages. The linker redirects malloc here (--wrap=malloc) because
   `allocate` offers no control over alignment or page size. */
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

#else
#define PREFETCH(address) ((void)(address))
#endif

void prefetch_integer(const int32_t *item) { PREFETCH(item); }

void prefetch_real(const double *item) { PREFETCH(item); }
