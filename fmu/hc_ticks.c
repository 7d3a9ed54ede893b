#include "hc_ticks.h"

#include <string.h>

size_t hc_ticks_size(const hc_model_type *model)
{
    return 2 * (size_t)model->n_ticks + 2 * (size_t)model->n_held;
}

void hc_ticks_place(hc_ticks *ticks, const hc_model_type *model, double share, double *numbers)
{
    ticks->model = model;
    ticks->next = DBL_MAX;
    ticks->at = 0.0;
    ticks->room = 0.0;
    for (int k = 0; k < model->n_ticks; k++) {
        const double room = share * model->tick_period[k] / model->fractions;
        ticks->room = k == 0 || room < ticks->room ? room : ticks->room;
    }
    ticks->ticked = 0;
    ticks->due = numbers;
    ticks->due_before = ticks->due + model->n_ticks;
    ticks->before = ticks->due_before + model->n_ticks;
    ticks->work = ticks->before + model->n_held;
}

void hc_ticks_hold(const hc_model_type *model, double *into, const double *from)
{
    const int n = model->n_states - model->n_held;
    for (int i = n; i < model->n_states; i++)
        into[i] = from[i];
}

static void find_next(hc_ticks *ticks)
{
    const hc_model_type *m = ticks->model;
    double first = DBL_MAX;
    for (int k = 0; k < m->n_ticks; k++)
        if (ticks->due[k] < first)
            first = ticks->due[k];
    ticks->next = m->n_ticks > 0 ? first / m->fractions : DBL_MAX;
}

void hc_ticks_start(hc_ticks *ticks, double t)
{
    const hc_model_type *m = ticks->model;
    const double early = t - ticks->room - hc_room(t);
    for (int k = 0; k < m->n_ticks; k++)
        ticks->due[k] = ceil(early * m->fractions / m->tick_period[k]) * m->tick_period[k];
    ticks->ticked = 0;
    find_next(ticks);
}

int hc_ticks_due(const hc_ticks *ticks, double t)
{
    return ticks->next < t || hc_ticks_same(ticks, t, ticks->next);
}

int hc_ticks_before(const hc_ticks *ticks, double t)
{
    return ticks->next < t && !hc_ticks_same(ticks, t, ticks->next);
}

void hc_ticks_take(hc_ticks *ticks, double t, double *x, const double *u, const double *p, const int *mode)
{
    const hc_model_type *m = ticks->model;
    double *held = x + (m->n_states - m->n_held);
    const size_t size = (size_t)m->n_held * sizeof *held;
    memcpy(ticks->due_before, ticks->due, (size_t)m->n_ticks * sizeof *ticks->due);
    memcpy(ticks->before, held, size);
    while (hc_ticks_due(ticks, t)) {
        const double now = ticks->next, count = now * m->fractions;
        for (int k = 0; k < m->n_ticks; k++) {
            if (!(ticks->due[k] <= count + 0.5))
                continue;
            memcpy(ticks->work, held, size);
            m->tick(k, now, x, u, p, mode, ticks->work);
            memcpy(held, ticks->work, size);
            ticks->due[k] += m->tick_period[k];
        }
        find_next(ticks);
    }
    ticks->at = t;
    ticks->ticked = 1;
}

void hc_ticks_again(hc_ticks *ticks, double t, double *x, const double *u, const double *p, const int *mode)
{
    const hc_model_type *m = ticks->model;
    memcpy(ticks->due, ticks->due_before, (size_t)m->n_ticks * sizeof *ticks->due);
    memcpy(x + (m->n_states - m->n_held), ticks->before, (size_t)m->n_held * sizeof *x);
    find_next(ticks);
    hc_ticks_take(ticks, t, x, u, p, mode);
}
