/* System calls whose constants, structures or errno are defined only in C headers: POSIX, and flock.
   The interfaces of these functions are in system.f90. Those that can fail return -1 and leave the reason in errno. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <time.h>
#include <unistd.h>

/* --- Clock and signals --- */

double system_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9*(double)now.tv_nsec;
}

/* All that a signal handler may write to. */
static volatile sig_atomic_t stop_signal, checkpoint_signals;
static volatile double first_stop_at;

/* How the program ends at a stop signal while there is nothing to lose. */
static struct {
    volatile sig_atomic_t code;  /* 0: there is something to lose */
    char message[256];
} ending;

/* Ends the program at once while there is nothing to lose. Else it only records the signal, and the main loop
   acts. Launchers often send a signal twice within moments; a second stop signal that comes later than that ends
   the program at once. */
static void note_signal(int number)
{
    const double moments = 0.5;
    const int kept = errno;
    if (number == SIGUSR1) {
        checkpoint_signals++;
    } else if (ending.code) {
        (void)!write(STDERR_FILENO, ending.message, strlen(ending.message));
        _exit(ending.code);
    } else if (!stop_signal) {
        first_stop_at = system_seconds();
        stop_signal = number;
    } else if (system_seconds() - first_stop_at > moments) {
        signal(number, SIG_DFL);
        raise(number);
    }
    errno = kept;
}

void system_watch_signals(void)
{
    const int watched[] = {SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGUSR1};
    struct sigaction action = {.sa_handler = note_signal, .sa_flags = SA_RESTART}, previous;
    sigfillset(&action.sa_mask);
    for (size_t k = 0; k < sizeof watched / sizeof *watched; k++)
        if (sigaction(watched[k], NULL, &previous) == 0 && previous.sa_handler != SIG_IGN)
            sigaction(watched[k], &action, NULL);
    signal(SIGXFSZ, SIG_IGN);
}

void system_end_at_signals(const char *message, int code)
{
    ending.code = 0;
    strncpy(ending.message, message, sizeof ending.message - 1);
    ending.code = code;
}

bool system_stop_requested(void) { return stop_signal != 0; }

int system_checkpoint_requests(void) { return checkpoint_signals; }

/* --- Standard streams and messages --- */

void system_fill_standard_streams(void)
{
    int descriptor;
    do descriptor = open("/dev/null", O_RDWR);
    while (descriptor >= 0 && descriptor <= STDERR_FILENO);
    if (descriptor > STDERR_FILENO) close(descriptor);
}

bool system_talks_to_terminal(void) { return isatty(STDERR_FILENO) == 1; }

/* Writes all bytes, also to a pipe that takes only some at a time. */
int system_print(const char *bytes)
{
    size_t count = strlen(bytes);
    while (count > 0) {
        const ssize_t written = write(STDOUT_FILENO, bytes, count);
        if (written >= 0) {
            bytes += written;
            count -= (size_t)written;
        } else if (errno == EAGAIN) {
            struct pollfd output = {.fd = STDOUT_FILENO, .events = POLLOUT};
            poll(&output, 1, -1);
        } else if (errno != EINTR) {
            return -1;
        }
    }
    return 0;
}

void system_describe_problem(char *text, size_t size)
{
    strncpy(text, strerror(errno), size - 1);
    text[size - 1] = '\0';
}

void system_name_host(char *text, size_t size)
{
    if (gethostname(text, size) != 0) strncpy(text, "unknown", size);
    text[size - 1] = '\0';
}

/* --- Files --- */

/* The one place where files are opened by a name that the user chose. */
static int open_file(const char *path, int flags)
{
    return open(path, flags | O_CLOEXEC, 0644);
}

/* Closes a file, keeps errno, and returns the status that the caller is to return. */
static int closed(int descriptor, int status)
{
    const int kept = errno;
    close(descriptor);
    errno = kept;
    return status;
}

/* Whether a file can be opened with these flags: 0 or -1. */
static int try_to_open(const char *path, int flags)
{
    const int descriptor = open_file(path, flags);
    return descriptor < 0 ? -1 : closed(descriptor, 0);
}

int system_try_to_read(const char *path) { return try_to_open(path, O_RDONLY); }

int system_try_to_update(const char *path) { return try_to_open(path, O_RDWR); }

int system_synchronize(const char *path)
{
    const int descriptor = open_file(path, O_RDONLY);
    return descriptor < 0 ? -1 : closed(descriptor, fsync(descriptor));
}

int system_find_folder(const char *path)
{
    struct stat found;
    return stat(path, &found) == 0 && S_ISDIR(found.st_mode) ? 0 : -1;
}

/* Succeeds also if another process was faster. */
int system_make_folder(const char *path)
{
    return mkdir(path, 0777) == 0 || errno == EEXIST ? 0 : -1;
}

int64_t system_free_bytes(const char *folder)
{
    struct statvfs disk;
    if (statvfs(folder, &disk) != 0 || disk.f_blocks == 0) return INT64_MAX;
    return (int64_t)disk.f_frsize*(int64_t)disk.f_bavail;
}

/* Returns a descriptor that holds the lock, -1 if another process has it, or -2 where there are no locks. */
int system_lock(const char *path)
{
    const int taken = -1, no_locks = -2;
    for (int trial = 0; trial < 100; trial++) {
        struct stat locked, named;
        const int descriptor = open_file(path, O_RDWR | O_CREAT);
        if (descriptor < 0) return no_locks;
        if (flock(descriptor, LOCK_EX | LOCK_NB) != 0)
            return closed(descriptor, errno == EWOULDBLOCK ? taken : no_locks);
        /* The previous holder may have removed the file meanwhile. A lock on a file without a name is worth nothing. */
        if (fstat(descriptor, &locked) == 0 && stat(path, &named) == 0 && locked.st_dev == named.st_dev &&
            locked.st_ino == named.st_ino)
            return descriptor;
        close(descriptor);
    }
    return taken;
}

void system_unlock(const char *path, int descriptor)
{
    unlink(path);
    close(descriptor);
}
