/* A barrier for threads that reach the barrier thousands of times per second, on cores that other programs may also
   use. A thread waits in a loop (spins) if its recent waits were short; if its recent waits were long, the thread
   sleeps. If the cores are otherwise idle, no time is lost. If the cores are busy, no thread uses up its time slice
   while it waits for a thread that is not running. The barriers of OpenMP either spin for milliseconds each time or
   never, depending on environment variables that are read when the program starts. The Fortran interfaces of this
   barrier are in team.f90. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <string.h>

double system_seconds(void);

struct barrier {
    atomic_int threads; /* number of threads that have joined */
    atomic_int arrived; /* number of threads that have arrived in this round */
    atomic_int round;
    pthread_mutex_t lock;
    pthread_cond_t released;
};
_Static_assert(sizeof(struct barrier) <= 256, "barrier_t in team.f90 keeps 256 bytes for it");

static const double longest_spin = 100e-6; /* in seconds */

static _Thread_local double usual_wait; /* running average of the waiting times of this thread [s] */

void barrier_open(struct barrier *self)
{
    memset(self, 0, sizeof *self);
    pthread_mutex_init(&self->lock, NULL);
    pthread_cond_init(&self->released, NULL);
}

void barrier_close(struct barrier *self)
{
    pthread_cond_destroy(&self->released);
    pthread_mutex_destroy(&self->lock);
}

void barrier_join(struct barrier *self) { self->threads++; }

static inline void relax(void)
{
#if defined __x86_64__ || defined __i386__
    __builtin_ia32_pause();
#elif defined __aarch64__
    __asm__ volatile("yield");
#endif
}

static void wait_for_release(struct barrier *self, int round)
{
    const double began = system_seconds();
    double waited = 0;
    for (int k = 0; usual_wait < longest_spin && waited < longest_spin && self->round == round; k++) {
        relax();
        if (k%32 == 31) waited = system_seconds() - began;
    }
    pthread_mutex_lock(&self->lock);
    while (self->round == round) pthread_cond_wait(&self->released, &self->lock);
    pthread_mutex_unlock(&self->lock);
    waited = system_seconds() - began;
    usual_wait += ((waited < 2*longest_spin ? waited : 2*longest_spin) - usual_wait)/8;
}

/* Returns true immediately for the last thread that arrives. For all other threads the function returns false after the
   last thread has called barrier_release. */
bool barrier_arrive(struct barrier *self)
{
    const int round = self->round;
    if (++self->arrived == self->threads) return true;
    wait_for_release(self, round);
    return false;
}

void barrier_release(struct barrier *self)
{
    self->arrived = 0;
    pthread_mutex_lock(&self->lock);
    self->round++;
    pthread_mutex_unlock(&self->lock);
    /* The broadcast follows the unlocking, so that a thread that wakes up does not have to wait for the lock. */
    pthread_cond_broadcast(&self->released);
}
