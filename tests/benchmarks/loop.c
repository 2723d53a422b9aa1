/* The work item of item.py as one writes it by hand for this loop alone: equations, Jacobian and
   elimination on paper, Rosenbrock steps of order 4 (Hairer and Wanner II, table IV.7.2,
   L-stable) that end at the samples and where w = 0. */
#include <math.h>
#include <string.h>
#include <time.h>

#define N 6
enum { TH, W, Z, ZH, WH, Q };

typedef struct {
    double J, s0, s1, Fc, Fs, Fv, vs, iJ, ivs; /* inverse of J and vs */
} Law;

typedef struct {
    Law a, b;
    double kp, ki, K1, K2;
} Loop;

/* rates, and what the Jacobian needs of them */
typedef struct {
    double g, gh, dg, dgh;
} Slopes;

static inline void rates(const Loop *p, const double *x, double r, double side, double *f,
                         Slopes *s)
{
    const Law *a = &p->a, *b = &p->b;
    double w = x[W], n = w * a->ivs, m = w * b->ivs;
    /* far above the Stribeck speed the term is below the last bit of Fc */
    double ea = n * n < 40.0 ? (a->Fs - a->Fc) * exp(-n * n) : 0.0;
    double eb = m * m < 40.0 ? (b->Fs - b->Fc) * exp(-m * m) : 0.0;
    double ia = 1.0 / (a->Fc + ea), ib = 1.0 / (b->Fc + eb);
    double g = a->s0 * side * w * ia, gh = b->s0 * side * w * ib;
    double dz = w - g * x[Z], dzh = w - gh * x[ZH] + p->K1 * (w - x[WH]);
    double e = w - r, push = -p->kp * e + p->ki * x[Q];
    double F = a->s0 * x[Z] + a->s1 * dz + a->Fv * w;
    double Fh = b->s0 * x[ZH] + b->s1 * dzh + b->Fv * w;
    f[TH] = w;
    f[W] = (push + Fh - F) * a->iJ;
    f[Z] = dz;
    f[ZH] = dzh;
    f[WH] = (push + p->K2 * (w - x[WH])) * b->iJ;
    f[Q] = -e;
    if (s) {
        s->g = g;
        s->gh = gh;
        s->dg = ia * (a->s0 * side + g * ea * 2.0 * n * a->ivs);
        s->dgh = ib * (b->s0 * side + gh * eb * 2.0 * m * b->ivs);
    }
}

/* I - d Jacobian with all but w eliminated */
typedef struct {
    double d, kz, kzw, kzh, kzhw, kzhwh, kwh, kwhw, kwhq, iw, wz, wzh, wwh, wq;
} Factors;

static inline void factor(const Loop *p, const double *x, const Slopes *s, double d, Factors *k)
{
    const Law *a = &p->a, *b = &p->b;
    double zw = 1.0 - s->dg * x[Z], zhw = 1.0 - s->dgh * x[ZH] + p->K1;
    double ja = d * a->iJ, jb = d * b->iJ;
    k->d = d;
    k->kz = 1.0 / (1.0 + d * s->g);
    k->kzw = d * zw;
    k->kzh = 1.0 / (1.0 + d * s->gh);
    k->kzhw = d * zhw;
    k->kzhwh = -d * p->K1;
    k->kwh = 1.0 / (1.0 + jb * p->K2);
    k->kwhw = jb * (p->K2 - p->kp);
    k->kwhq = jb * p->ki;
    k->wz = -ja * (a->s0 - a->s1 * s->g);
    k->wzh = ja * (b->s0 - b->s1 * s->gh);
    k->wwh = -ja * b->s1 * p->K1;
    k->wq = ja * p->ki;
    /* q = bq - d w;  wh = kwh (bwh + kwhw w + kwhq q);  z, zh likewise */
    double whw = k->kwh * (k->kwhw - k->kwhq * d);
    double ww = ja * (-p->kp + b->s1 * zhw + b->Fv - a->s1 * zw - a->Fv);
    double rest = k->wz * k->kz * k->kzw - k->wq * d + k->wwh * whw;
    rest += k->wzh * k->kzh * (k->kzhw + k->kzhwh * whw);
    k->iw = 1.0 / (1.0 - ww - rest);
}

static inline void solve(const Factors *k, const double *b, double *v)
{
    double wh = k->kwh * (b[WH] + k->kwhq * b[Q]);
    double z = k->kz * b[Z], zh = k->kzh * (b[ZH] + k->kzhwh * wh);
    double w = (b[W] + k->wz * z + k->wzh * zh + k->wwh * wh + k->wq * b[Q]) * k->iw;
    v[W] = w;
    v[Q] = b[Q] - k->d * w;
    v[WH] = k->kwh * (b[WH] + k->kwhw * w + k->kwhq * v[Q]);
    v[Z] = z + k->kz * k->kzw * w;
    v[ZH] = k->kzh * (b[ZH] + k->kzhw * w + k->kzhwh * v[WH]);
    v[TH] = b[TH] + k->d * w;
}

/* one step; returns the error relative to the sizes */
static double step(const Loop *p, const double *x, double r, double slope, double h, double side,
                   const double *size, double *y)
{
    static const double G = 0.57282;
    double f[N], b[N], v1[N], v2[N], v3[N], v4[N], s[N], d = G * h, hd = d * h;
    /* kp dr/dt reaches w and wh, dr/dt reaches q */
    double fw = p->kp * slope * p->a.iJ, fwh = p->kp * slope * p->b.iJ;
    Slopes sl;
    Factors k;
    rates(p, x, r, side, f, &sl);
    factor(p, x, &sl, d, &k);
#define DRIFT(c) (b[W] += hd * (c) * fw, b[WH] += hd * (c) * fwh, b[Q] += hd * (c) * slope)
    for (int i = 0; i < N; i++)
        b[i] = d * f[i];
    DRIFT(0.57282);
    solve(&k, b, v1);
    for (int i = 0; i < N; i++)
        s[i] = x[i] + 2.0 * v1[i];
    rates(p, s, r + 1.14564 * h * slope, side, f, 0);
    for (int i = 0; i < N; i++)
        b[i] = d * f[i] + G * -7.137615036412310 * v1[i];
    DRIFT(-1.769193891319233);
    solve(&k, b, v2);
    for (int i = 0; i < N; i++)
        s[i] = x[i] + 1.867943637803922 * v1[i] + 0.2344449711399156 * v2[i];
    rates(p, s, r + 0.65521686381559 * h * slope, side, f, 0);
    for (int i = 0; i < N; i++)
        b[i] = d * f[i] + G * (2.580708087951457 * v1[i] + 0.6515950076447975 * v2[i]);
    DRIFT(0.7592633437920482);
    solve(&k, b, v3);
    for (int i = 0; i < N; i++)
        b[i] = d * f[i] + G * (-2.137148994382534 * v1[i] - 0.3214669691237626 * v2[i] -
                               0.6949742501781779 * v3[i]);
    DRIFT(-0.1049021087100450);
    solve(&k, b, v4);
    double error = 0.0;
    for (int i = 0; i < N; i++) {
        y[i] = x[i] + 2.255570073418735 * v1[i] + 0.2870493262186792 * v2[i] +
               0.4353179431840180 * v3[i] + 1.093502252409163 * v4[i];
        double e = 0.2815431932141155 * v1[i] + 0.07276199124938920 * v2[i] +
                   0.1082196201495311 * v3[i] + 1.093502252409163 * v4[i];
        e = fabs(e) / fmax(size[i], fabs(y[i]));
        error = e > error ? e : error;
    }
    return error;
}

/* states at the samples, n rows of N; returns the number of steps */
int run(const Loop *p, const double *t, const double *r, int n, const double *start, double rtol,
        double *out)
{
    double x[N], y[N], size[N], next = 0.01 * (t[1] - t[0]), side = -1.0;
    int steps = 0;
    memcpy(x, start, sizeof x);
    memcpy(out, start, sizeof x);
    for (int i = 0; i < N; i++)
        size[i] = fabs(x[i]) + 1e-9;
    for (int k = 0; k + 1 < n; k++) {
        double dt = t[k + 1] - t[k], done = 0.0, slope = (r[k + 1] - r[k]) / dt;
        while (done < dt) {
            double left = dt - done, h = next < left ? next : left;
            double error = step(p, x, r[k] + slope * done, slope, h, side, size, y) / rtol;
            steps++;
            if (!(error <= 1.0)) {
                next = h * fmax(0.1, 0.9 / sqrt(sqrt(error)));
                continue;
            }
            int met = 0;
            if (y[W] * side < 0.0) { /* to the zero of w by regula falsi, then the other side */
                double low = 0.0, high = h, at_low = x[W], at_high = y[W];
                met = 1;
                for (int i = 0; i < 60 && fabs(y[W]) > 1e-13 * size[W]; i++) {
                    double part = i % 3 == 2 ? 0.5 : at_low / (at_low - at_high);
                    h = low + (high - low) * part;
                    step(p, x, r[k] + slope * done, slope, h, side, size, y);
                    steps++;
                    if (y[W] * side < 0.0)
                        high = h, at_high = y[W];
                    else
                        low = h, at_low = y[W];
                }
                side = -side;
            }
            memcpy(x, y, sizeof x);
            for (int i = 0; i < N; i++)
                size[i] = fmax(size[i], fabs(x[i]));
            done = h >= left ? dt : done + h;
            if (!met) {
                double longer = h * fmin(5.0, 0.9 / sqrt(sqrt(fmax(error, 1e-8))));
                next = h >= next || longer > next ? longer : next;
            }
        }
        memcpy(out + N * (k + 1), x, sizeof x);
    }
    return steps;
}

/* the shortest of several runs, in seconds of processor time */
double best(const Loop *p, const double *t, const double *r, int n, const double *start,
            double rtol, double *out, int times)
{
    double least = INFINITY;
    for (int i = 0; i < times; i++) {
        struct timespec a, b;
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
        run(p, t, r, n, start, rtol, out);
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
        least = fmin(least, (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec));
    }
    return least;
}
