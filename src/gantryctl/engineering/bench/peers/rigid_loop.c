/* The rigid job as a plain C loop: the yardstick for the compiled closed loop. One inertia with an eccentric
   moment, ideal encoder, no friction; P position loop at 1 ms, PI speed loop at 125 us; trapezoid 0 to 90
   deg. Prints the processor time, s, and the motor angle at every whole second, rad. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int main(int argc, char** argv) {
  const int seconds = argc > 1 ? atoi(argv[1]) : 60;
  const int repeats = argc > 2 ? atoi(argv[2]) : 1;
  double* angles = malloc(sizeof(double) * (size_t)seconds);
  const double deg = 3.14159265358979323846 / 180.0;
  const double i = 1144.0, js = 2.18e6 / (i * i) + 0.362, tu = -15990.3;
  const double kpp = 10.0, kvf = 1.0, kvp = 77.6959, tvi = 0.01, limit = 385.0;
  const double ts = 125e-6, tp = 1e-3, a = 450.0 / 1144.0 * deg, target = 90.0 * deg;
  const double half = sqrt(target / a);
  double thm = 0.0;
  const double start = now();
  for (int n = 0; n < repeats; ++n) {
    double wm = 0.0, integral = 0.0, last = 0.0;
    thm = 0.0;
    for (long k = 0; k < 1000L * seconds; ++k) {
      const double t = (double)k * tp;
      double r, v;
      if (t < half) {
        r = 0.5 * a * t * t, v = a * t;
      } else if (t < 2.0 * half) {
        const double left = 2.0 * half - t;
        r = target - 0.5 * a * left * left, v = a * left;
      } else {
        r = target, v = 0.0;
      }
      const double command = kpp * (i * r - thm) + kvf * i * v;
      for (int c = 0; c < 8; ++c) {
        const double measured = (thm - last) / ts;
        last = thm;
        const double e = command - measured;
        const double un = kvp * (e + integral);
        double u = un;
        if (u > limit) u = limit;
        if (u < -limit) u = -limit;
        if (u == un || (un - u) * e < 0.0) integral += e * ts / tvi;
        wm += ts * (u + tu * sin(thm / i) / i) / js;
        thm += ts * wm;
      }
      if (k % 1000 == 999) angles[k / 1000] = thm;
    }
  }
  printf("%.9f\n", (now() - start) / repeats);
  for (int n = 0; n < seconds; ++n) printf("%.15g\n", angles[n]);
  free(angles);
  return 0;
}
