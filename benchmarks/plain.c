/* The schemes of headway's kernel as plain C loops over one law, for comparison of speed.

   Compiled once per law: -DLAW=IDM|OVM|CACC|GMM, -DEQUAL=1 where all vehicles share their parameters
   (they are then read once), -DPREPARED=1 to compute what depends on parameters alone before the run.
   Arrays are [vehicle][lane], vehicle 0 the leader; `lead` holds its exact position, speed and
   acceleration every half step, from `late` steps before t = 0 on, the same in all lanes. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define IDM 0
#define OVM 1
#define CACC 2
#define GMM 3

#if EQUAL
#define P(j) par[(j) * size]
#else
#define P(j) par[(j) * size + i]
#endif

static inline double tanh_(double x)
{
#if LIBM
    return tanh(x);
#else /* as headway.maths has it: plain arithmetic, error below 4e-16, vectorises */
    x = x > 20.0 ? 20.0 : (x < -20.0 ? -20.0 : x);
    double y = x * 0.03125, q = y * y;
    double t = y * (10395.0 + q * (1260.0 + q * 21.0)) / (10395.0 + q * (4725.0 + q * (210.0 + q)));
    for (int j = 0; j < 5; j++)
        t = 2.0 * t / (1.0 + t * t);
    return t;
#endif
}

/* Parameters in headway's order. IDM: a b T s0 v0; OVM: alpha v0 h w; CACC: kp kd kv ka h r; GMM: alpha. */
static void prepare(double *restrict par, long size)
{
#if PREPARED
    for (long i = 0; i < size; i++) {
#if LAW == IDM
        par[size + i] = 1.0 / (2.0 * sqrt(par[i] * par[size + i]));
        par[4 * size + i] = 1.0 / par[4 * size + i];
#elif LAW == OVM
        double h = par[2 * size + i], w = par[3 * size + i];
        par[3 * size + i] = 1.0 / w;
        par[4 * size + i] = tanh_(h / w);
#elif LAW == CACC
        double kd = par[size + i], h = par[4 * size + i];
        par[6 * size + i] = 1.0 / (1.0 + kd * h);
#endif
    }
#else
    (void)par, (void)size;
#endif
}

#if LAW == IDM
#if PREPARED
#define DAMPING(v, dv) ((v) * (dv) * P(1))
#define RATIO(v) ((v) * P(4))
#else
#define DAMPING(v, dv) ((v) * (dv) / (2.0 * sqrt(P(0) * P(1))))
#define RATIO(v) ((v) / P(4))
#endif
#elif LAW == OVM
#if PREPARED
#define OPTIMAL(s) (P(1) * (tanh_(((s) - P(2)) * P(3)) + P(4)))
#else
#define OPTIMAL(s) (P(1) * (tanh_(((s) - P(2)) / P(3)) + tanh_(P(2) / P(3))))
#endif
#elif LAW == CACC
#if PREPARED
#define SOLVED(u) ((u) * P(6))
#else
#define SOLVED(u) ((u) / (1.0 + P(1) * P(4)))
#endif
#endif

#if LAW != CACC

/* accelerations of all followers at positions X and speeds V */
static void rate(double *restrict A, const double *restrict X, const double *restrict V, const double *restrict VL,
                 const double *restrict AL, const double *restrict length, const double *restrict par, long size,
                 long lanes)
{
    (void)VL, (void)AL;
    for (long i = 0; i < size; i++) {
        double s = X[i] - X[i + lanes] - length[i], v = V[i + lanes];
#if LAW == IDM
        double dv = V[i] - v, desired = P(3) + P(2) * v - DAMPING(v, dv);
        double ratio = RATIO(v < 0.0 ? 0.0 : v), closeness = desired / s;
        ratio *= ratio;
        A[i + lanes] = P(0) * (1.0 - ratio * ratio - closeness * closeness);
#elif LAW == OVM
        A[i + lanes] = P(0) * (OPTIMAL(s) - v);
#else
        A[i + lanes] = P(0) * (v < 0.0 ? 0.0 : v) / (s * s) * (V[i] - v);
#endif
    }
}

#else

#define FEEDBACK (P(0) * (s - P(5) - P(4) * v) + P(1) * (V[i] - v) + P(2) * (vl - v))

/* the same with speeds VL and accelerations AL of the vehicles ahead as received; AL = 0: the current ones */
static void rate(double *restrict A, const double *restrict X, const double *restrict V, const double *restrict VL,
                 const double *restrict AL, const double *restrict length, const double *restrict par, long size,
                 long lanes)
{
    if (AL) {
        for (long i = 0; i < size; i++) {
            double s = X[i] - X[i + lanes] - length[i], v = V[i + lanes], vl = VL[i];
            A[i + lanes] = SOLVED(FEEDBACK + P(3) * AL[i]);
        }
    } else if (lanes >= 8) {
        for (long first = 0; first < size; first += lanes) {
            double *own = A + lanes;
            const double *ahead = A;
#pragma GCC ivdep
            for (long i = first; i < first + lanes; i++) {
                double s = X[i] - X[i + lanes] - length[i], v = V[i + lanes], vl = V[i];
                own[i] = SOLVED(FEEDBACK + P(3) * ahead[i]);
            }
        }
    } else { /* all that is independent first, then the chain */
        for (long i = 0; i < size; i++) {
            double s = X[i] - X[i + lanes] - length[i], v = V[i + lanes], vl = V[i];
            A[i + lanes] = SOLVED(FEEDBACK);
        }
        for (long i = 0; i < size; i++)
            A[i + lanes] += SOLVED(P(3)) * A[i];
    }
}

#endif

static void fill(double *row, double value, long lanes)
{
    for (long b = 0; b < lanes; b++)
        row[b] = value;
}

static void keep(double *restrict out, const double *x, const double *v, const double *a, long all)
{
    memcpy(out, x, all * sizeof *x);
    memcpy(out + all, v, all * sizeof *v);
    memcpy(out + 2 * all, a, all * sizeof *a);
}

/* X = x + c v + d k, V = v + c l */
static void stage(double *restrict X, double *restrict V, const double *restrict x, const double *restrict v,
                  const double *restrict k, const double *restrict l, double c, double d, long lanes, long all)
{
    for (long i = lanes; i < all; i++) {
        X[i] = x[i] + c * v[i] + d * k[i];
        V[i] = v[i] + c * l[i];
    }
}

static void step(double *restrict xn, double *restrict vn, const double *restrict x, const double *restrict v,
                 const double *restrict k1, const double *restrict k2, const double *restrict k3,
                 const double *restrict k4, double h, long lanes, long all)
{
    for (long i = lanes; i < all; i++) {
        xn[i] = x[i] + h * v[i] + h * h / 6.0 * (k1[i] + k2[i] + k3[i]);
        vn[i] = v[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
}

/* middle of a step: the cubic with values p, q and slopes r, t at its ends */
static void middle(double *restrict out, const double *restrict p, const double *restrict q, const double *restrict r,
                   const double *restrict t, double h, long size)
{
    for (long i = 0; i < size; i++)
        out[i] = 0.5 * (p[i] + q[i]) + 0.125 * h * (r[i] - t[i]);
}

/* slope of the speed's cubic there */
static void middle_slope(double *restrict out, const double *restrict p, const double *restrict q,
                         const double *restrict r, const double *restrict t, double h, long size)
{
    for (long i = 0; i < size; i++)
        out[i] = 1.5 / h * (q[i] - p[i]) - 0.25 * (r[i] + t[i]);
}

/* Largest magnitude so far of gap minus gap at the start. */
static void largest(double *restrict peak, const double *restrict x, const double *restrict x0,
                    const double *restrict length, long lanes, long size)
{
    for (long i = 0; i < size; i++) {
        double start = x0[i] - length[i] - x0[i + lanes], e = fabs(x[i] - length[i] - x[i + lanes] - start);
        peak[i] = e > peak[i] ? e : peak[i];
    }
}

/* Integrates `steps` steps of length h; every `every`-th start and the end go to `out` (., 3, all), and the peak of
   the spacing error at all steps to `peak` (size), if given. */
void integrate(int ballistic, long followers, long lanes, long steps, double h, long late, const double *lead,
               const double *length, const double *given, long rows, const double *x0, const double *v0, double cruise,
               long every, double *out, double *peak)
{
    long size = followers * lanes, all = size + lanes, ring = late + 2;
    double *memory = aligned_alloc(64, (((4 * ring + 8) * all + (rows + 1) * size) * sizeof(double) / 64 + 1) * 64);
    if (!memory)
        return;
    double *xs = memory, *vs = xs + ring * all, *as = vs + ring * all;
    double *ls = LAW == CACC ? as + ring * all : as, *X = ls + ring * all; /* ls: accelerations from the left */
    double *V = X + all, *k1 = V + all, *k2 = k1 + all, *k3 = k2 + all, *k4 = k3 + all, *VL = k4 + all, *AL = VL + all;
    double *par = AL + all;
    memcpy(par, given, rows * size * sizeof *par);
    prepare(par, size);
    for (long k = -late; k <= 0; k++) { /* the time before 0: everybody at constant speed */
        long r = (k + ring) % ring * all;
        for (long i = 0; i < all; i++) {
            xs[r + i] = x0[i] + k * h * cruise;
            vs[r + i] = v0[i];
            as[r + i] = ls[r + i] = 0.0;
        }
    }
    for (long k = 0; k < steps; k++) {
        const double *now = lead + 6 * (k + late), *past = lead + 6 * k;
        long r = k % ring * all, n = (k + 1) % ring * all;
        long p = (k - late + ring) % ring * all, q = (k - late + 1 + ring) % ring * all;
        double *x = xs + r, *v = vs + r, *a = as + r, *xn = xs + n, *vn = vs + n, *an = ls + n;
        fill(x, now[0], lanes), fill(v, now[1], lanes), fill(a, now[2], lanes);
        if (peak)
            largest(peak, x, x0, length, lanes, size);
        if (ballistic) {
            if (late == 0)
                rate(a, x, v, 0, 0, length, par, size, lanes);
            else if (LAW == CACC)
                rate(a, x, v, vs + p, as + p, length, par, size, lanes);
            else
                rate(a, xs + p, vs + p, 0, 0, length, par, size, lanes);
            if (k % every == 0)
                keep(out, x, v, a, all), out += 3 * all;
            for (long i = lanes; i < all; i++) {
                double u = v[i] + h * a[i];
                int stops = u < 0.0;
                xn[i] = x[i] + (stops ? -0.5 * v[i] * v[i] / a[i] : 0.5 * h * (v[i] + u));
                vn[i] = stops ? 0.0 : u;
            }
            continue;
        }
        const double *half = now + 3, *end = now + 6;
        if (late == 0) { /* the classical method */
            rate(a, x, v, 0, 0, length, par, size, lanes);
            fill(X, half[0], lanes), fill(V, half[1], lanes), fill(k2, half[2], lanes), fill(k3, half[2], lanes);
            stage(X, V, x, v, a, a, 0.5 * h, 0.0, lanes, all);
            rate(k2, X, V, 0, 0, length, par, size, lanes);
            stage(X, V, x, v, a, k2, 0.5 * h, 0.25 * h * h, lanes, all);
            rate(k3, X, V, 0, 0, length, par, size, lanes);
            fill(X, end[0], lanes), fill(V, end[1], lanes), fill(k4, end[2], lanes);
            stage(X, V, x, v, k2, k3, h, 0.5 * h * h, lanes, all);
            rate(k4, X, V, 0, 0, length, par, size, lanes);
            step(xn, vn, x, v, a, k2, k3, k4, h, lanes, all);
        } else if (LAW != CACC) { /* all signals late: both middle stages are one, the end is the next start */
            if (k == 0)
                rate(a, xs + p, vs + p, 0, 0, length, par, size, lanes);
            middle(X, xs + p, xs + q, vs + p, vs + q, h, all);
            middle(V, vs + p, vs + q, as + p, ls + q, h, all);
            fill(X, past[3], lanes), fill(V, past[4], lanes);
            rate(k2, X, V, 0, 0, length, par, size, lanes);
            rate(an, xs + q, vs + q, 0, 0, length, par, size, lanes);
            step(xn, vn, x, v, a, k2, k2, an, h, lanes, all);
        } else { /* received signals late: accelerations jump wherever the leader's first jump arrives */
            if (k % late == 0)
                rate(a, x, v, vs + p, as + p, length, par, size, lanes);
            middle(VL, vs + p, vs + q, as + p, ls + q, h, size);
            middle_slope(AL, vs + p, vs + q, as + p, ls + q, h, size);
            fill(VL, past[4], lanes), fill(AL, past[5], lanes);
            fill(X, half[0], lanes), fill(V, half[1], lanes);
            stage(X, V, x, v, a, a, 0.5 * h, 0.0, lanes, all);
            rate(k2, X, V, VL, AL, length, par, size, lanes);
            stage(X, V, x, v, a, k2, 0.5 * h, 0.25 * h * h, lanes, all);
            rate(k3, X, V, VL, AL, length, par, size, lanes);
            fill(X, end[0], lanes), fill(V, end[1], lanes);
            stage(X, V, x, v, k2, k3, h, 0.5 * h * h, lanes, all);
            rate(k4, X, V, vs + q, ls + q, length, par, size, lanes);
            step(xn, vn, x, v, a, k2, k3, k4, h, lanes, all);
            fill(xn, end[0], lanes), fill(vn, end[1], lanes), fill(an, end[2], lanes);
            rate(an, xn, vn, vs + q, ls + q, length, par, size, lanes);
        }
        if (k % every == 0)
            keep(out, x, v, a, all), out += 3 * all;
        if (late && LAW == CACC)
            memcpy(as + n, an, all * sizeof *an);
    }
    long r = steps % ring * all;
    fill(xs + r, lead[6 * (steps + late)], lanes), fill(vs + r, lead[6 * (steps + late) + 1], lanes);
    keep(out, xs + r, vs + r, as + r, all);
    free(memory);
}
