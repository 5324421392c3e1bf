/* The declared table (6.3)-(6.14), (3.19) in C, written from the equation sheet, with the pair 5(4) of Dormand and Prince
   under error control: the same job as the package's, for its speed. Six states: x, v, P_A, P_B, x_s, rate of x_s.
   The constants are those of test/reference_model.py in their order. */
#include <math.h>
#include <time.h>

typedef struct {
    double area, half_volume, mass, half_stroke, stop_stiffness, stop_damping, supply, tank, omega, damping, rate_limit,
        friction, flow, underlap, laminar, modulus, coulomb, rise, decay, viscous, sharp, internal, external, lambda_1,
        lambda_2, mu, edge;
} table;

static double clip(double x, double low, double high) { return x < low ? low : (x > high ? high : x); }

static double edge_flow(const table *c, double opening, double drop)
{
    if (opening <= 0.0)
        return 0.0;
    return clip(opening, 0.0, 1.0) * drop / sqrt(sqrt(drop * drop + c->laminar * c->laminar));
}

static void rates(const table *c, const double *y, double wanted, double *f)
{
    const double x = y[0], v = y[1], p_a = y[2], p_b = y[3], s = y[4], load = p_a - p_b;
    const double q_a = c->flow * (edge_flow(c, s + c->underlap, c->supply - p_a) - edge_flow(c, c->underlap - s, p_a - c->tank));
    const double q_b = c->flow * (edge_flow(c, s + c->underlap, p_b - c->tank) - edge_flow(c, c->underlap - s, c->supply - p_b));
    double stiffness = c->modulus * c->lambda_1;
    if (c->lambda_2 != 0.0)
        stiffness -= c->modulus * c->lambda_2 * (tanh(c->mu * (load + c->edge)) - tanh(c->mu * (load - c->edge)));
    double force = c->area * load - (c->coulomb + c->rise * exp(-c->decay * fabs(v))) * tanh(v / c->sharp) - c->viscous * v;
    if (x > c->half_stroke)
        force -= fmax(c->stop_stiffness * (x - c->half_stroke) + c->stop_damping * v, 0.0);
    else if (x < -c->half_stroke)
        force -= fmin(c->stop_stiffness * (x + c->half_stroke) + c->stop_damping * v, 0.0);
    const double v_a = fmax(c->half_volume + c->area * x, 0.02 * c->half_volume);
    const double v_b = fmax(c->half_volume - c->area * x, 0.02 * c->half_volume);
    const double leak = c->internal * load;
    f[0] = v;
    f[1] = force / c->mass;
    f[2] = stiffness / v_a * (q_a - c->external * p_a - leak - c->area * v);
    f[3] = stiffness / v_b * (-q_b - c->external * p_b + leak + c->area * v);
    f[4] = clip(y[5], -c->rate_limit, c->rate_limit);
    f[5] = c->omega * (c->omega * (wanted - s) - 2.0 * c->damping * y[5]);
}

static const double A[6][6] = {
    {1.0 / 5},
    {3.0 / 40, 9.0 / 40},
    {44.0 / 45, -56.0 / 15, 32.0 / 9},
    {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
    {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
    {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
static const double E[7] = {71.0 / 57600, 0.0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40};

static double processor_time(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

/* Accelerations at n samples under held commands, without hysteresis; y is the first state and becomes the last one.
   Returns the processor time that it took [s]. */
double simulate(const table *c, const double *commands, long n, double dt, double rtol, const double *scales, double *y,
              double *acceleration)
{
    const double begun = processor_time();
    double k[7][6], stage[6], h = 0.5 * dt;
    for (long sample = 0; sample < n; sample++) {
        const double u = clip(commands[sample], -1.0, 1.0);
        double done = 0.0;
        rates(c, y, u, k[0]);
        acceleration[sample] = k[0][1];
        while (done < dt) {
            const double rest = dt - done;
            const int last = h >= 0.999 * rest;
            const double step = last ? rest : h;
            double error = 0.0;
            for (int j = 0; j < 6; j++) {
                for (int i = 0; i < 6; i++) {
                    double s = 0.0;
                    for (int m = 0; m <= j; m++)
                        s += A[j][m] * k[m][i];
                    stage[i] = y[i] + step * s;
                }
                rates(c, stage, u, k[j + 1]);
            }
            for (int i = 0; i < 6; i++) {
                double slip = 0.0;
                for (int m = 0; m < 7; m++)
                    slip += E[m] * k[m][i];
                error = fmax(error, fabs(step * slip) / (rtol * (scales[i] + fabs(y[i]))));
            }
            if (error > 1.0 && step > 1e-7) {
                h = step * fmax(0.9 * pow(error, -0.2), 0.1);
                continue;
            }
            for (int i = 0; i < 6; i++) {
                y[i] = stage[i];
                k[0][i] = k[6][i];
            }
            if (fabs(y[4]) > 1.0) {
                y[4] = clip(y[4], -1.0, 1.0);
                y[5] = 0.0;
                rates(c, y, u, k[0]);
            }
            done = last ? dt : done + step;
            const double proposed = step * clip(0.9 * pow(fmax(error, 1e-6), -0.2), 0.2, 5.0);
            h = last && step < h ? fmax(proposed, h) : proposed;
        }
    }
    return processor_time() - begun;
}
