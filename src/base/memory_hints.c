/* Memory functions that Fortran does not provide: hints, which affect only the speed and the memory use of a run, and
   an error message when memory is exhausted. The code depends on the compiler, the linker and the operating system. If
   the macro MEMORY_HINTS is undefined (see HINTS in the Makefile), the functions do nothing, and after a failed
   `allocate` the Fortran run-time library prints its own error message. */
#include <stdint.h>

#ifdef MEMORY_HINTS
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/mman.h>
#endif

#define PREFETCH(address) __builtin_prefetch(address)

static const size_t line = 64, large = 128*1024, page = 2*1024*1024;

/* Checks every memory allocation, including those of temporary arrays. If memory is exhausted, an error message is
   printed and the program ends with exit code 3. Data already committed to files remain valid. */
static void *obtained(void *memory, size_t bytes)
{
    if (!memory && bytes) {
        char text[240];
        snprintf(text, sizeof text, "%sout of memory: there is no room for %zu bytes; use fewer disks or a smaller "
                 "initial-configuration file, or raise the limit of memory (ulimit -v, batch job)\n",
                 isatty(STDERR_FILENO) == 1 ? "\r\033[K" : "", bytes);
        (void)!write(STDERR_FILENO, text, strlen(text));
        _exit(3);
    }
    return memory;
}

/* Aligns large arrays to cache lines, so that a record of 64 bytes occupies a single line. Arrays of at least 2 MB are
   placed on huge pages if the system provides them, because the TLB (the cache of page addresses) has room for only a
   few pages. The Fortran statement `allocate` cannot control alignment or page size; therefore the linker option
   --wrap=malloc redirects all calls of malloc to this function. */
void *__real_malloc(size_t bytes);
__attribute__((used)) void *__wrap_malloc(size_t bytes)
{
    void *memory;
    if (bytes < large) return obtained(__real_malloc(bytes), bytes);
    if (posix_memalign(&memory, bytes < page ? line : page, bytes)) memory = NULL;
#ifdef MADV_HUGEPAGE
    if (memory && bytes >= page) madvise(memory, bytes / page * page, MADV_HUGEPAGE);
#endif
    return obtained(memory, bytes);
}

void *__real_realloc(void *memory, size_t bytes);
__attribute__((used)) void *__wrap_realloc(void *memory, size_t bytes)
{
    return obtained(__real_realloc(memory, bytes), bytes);
}

#else
#define PREFETCH(address) ((void)(address))
#endif

void prefetch_integer(const int32_t *item) { PREFETCH(item); }

void prefetch_real(const double *item) { PREFETCH(item); }
