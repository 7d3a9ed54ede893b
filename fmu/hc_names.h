/* All external names of the runtime. If HC_PREFIX is defined each begins with it, so that several FMUs can be linked
 * into one program.
 */
#ifndef HC_NAMES_H
#define HC_NAMES_H

#ifdef HC_PREFIX
#define HC_JOIN(prefix, name) prefix##name
#define HC_JOIN_NAMES(prefix, name) HC_JOIN(prefix, name)
#define HC_NAME(name) HC_JOIN_NAMES(HC_PREFIX, name)

/* generated with the model */
#define hc_model HC_NAME(hc_model)
#define hc_description HC_NAME(hc_description)
#define hc_late HC_NAME(hc_late)
#define hc_surroundings HC_NAME(hc_surroundings)

/* hc_messages.c */
#define hc_discard HC_NAME(hc_discard)
#define hc_fail HC_NAME(hc_fail)
#define hc_log_message HC_NAME(hc_log_message)
#define hc_name_states HC_NAME(hc_name_states)
#define hc_no_null HC_NAME(hc_no_null)
#define hc_not_supported HC_NAME(hc_not_supported)
#define hc_refuse_kind HC_NAME(hc_refuse_kind)
#define hc_refuse_state HC_NAME(hc_refuse_state)
#define hc_set_logging HC_NAME(hc_set_logging)

/* hc_values.c */
#define hc_called HC_NAME(hc_called)
#define hc_check_finite HC_NAME(hc_check_finite)
#define hc_evaluate HC_NAME(hc_evaluate)
#define hc_fail_at HC_NAME(hc_fail_at)
#define hc_find_modes HC_NAME(hc_find_modes)
#define hc_get_modes HC_NAME(hc_get_modes)
#define hc_get_reals HC_NAME(hc_get_reals)
#define hc_invalidate HC_NAME(hc_invalidate)
#define hc_no_variable HC_NAME(hc_no_variable)
#define hc_read_states HC_NAME(hc_read_states)
#define hc_set_reals HC_NAME(hc_set_reals)

/* hc_instance.c */
#define hc_exit_initialization HC_NAME(hc_exit_initialization)
#define hc_fail_ticks HC_NAME(hc_fail_ticks)
#define hc_instance_free HC_NAME(hc_instance_free)
#define hc_instance_new HC_NAME(hc_instance_new)
#define hc_refuse_late HC_NAME(hc_refuse_late)
#define hc_reset HC_NAME(hc_reset)
#define hc_set_experiment HC_NAME(hc_set_experiment)
#define hc_take_inputs HC_NAME(hc_take_inputs)
#define hc_tell_solver HC_NAME(hc_tell_solver)

/* hc_partials.c */
#define hc_output_derivatives HC_NAME(hc_output_derivatives)
#define hc_partial_derivatives HC_NAME(hc_partial_derivatives)

/* hc_model_exchange.c */
#define hc_completed_step HC_NAME(hc_completed_step)
#define hc_next_event HC_NAME(hc_next_event)
#define hc_enter_event_mode HC_NAME(hc_enter_event_mode)
#define hc_get_nominals HC_NAME(hc_get_nominals)
#define hc_get_part HC_NAME(hc_get_part)
#define hc_set_states HC_NAME(hc_set_states)
#define hc_set_time HC_NAME(hc_set_time)

/* hc_event_mode.c */
#define hc_leave_event_mode HC_NAME(hc_leave_event_mode)
#define hc_log_modes HC_NAME(hc_log_modes)
#define hc_update_discrete_states HC_NAME(hc_update_discrete_states)

/* hc_co_simulation.c */
#define hc_do_step HC_NAME(hc_do_step)

/* hc_saved_state.c */
#define hc_count_state HC_NAME(hc_count_state)
#define hc_state_free HC_NAME(hc_state_free)
#define hc_state_get HC_NAME(hc_state_get)
#define hc_state_read HC_NAME(hc_state_read)
#define hc_state_set HC_NAME(hc_state_set)
#define hc_state_size HC_NAME(hc_state_size)
#define hc_state_write HC_NAME(hc_state_write)
#define hc_transfer HC_NAME(hc_transfer)

/* hc_solver.c */
#define hc_solver_advance HC_NAME(hc_solver_advance)
#define hc_solver_counts HC_NAME(hc_solver_counts)
#define hc_solver_free HC_NAME(hc_solver_free)
#define hc_solver_modes HC_NAME(hc_solver_modes)
#define hc_solver_new HC_NAME(hc_solver_new)
#define hc_solver_restart HC_NAME(hc_solver_restart)
#define hc_solver_set HC_NAME(hc_solver_set)
#define hc_solver_states HC_NAME(hc_solver_states)
#define hc_solver_step HC_NAME(hc_solver_step)
#define hc_solver_time HC_NAME(hc_solver_time)
#define hc_solver_tolerance HC_NAME(hc_solver_tolerance)

/* hc_methods.c */
#define hc_step_bogacki_shampine HC_NAME(hc_step_bogacki_shampine)
#define hc_step_dormand_prince HC_NAME(hc_step_dormand_prince)
#define hc_step_rk4 HC_NAME(hc_step_rk4)

/* hc_dop853.c */
#define hc_dense_dop853 HC_NAME(hc_dense_dop853)
#define hc_step_dop853 HC_NAME(hc_step_dop853)

/* hc_step_length.c */
#define hc_choose_and_step HC_NAME(hc_choose_and_step)
#define hc_first_length HC_NAME(hc_first_length)

/* hc_dense.c */
#define hc_interpolate HC_NAME(hc_interpolate)
#define hc_make_dense HC_NAME(hc_make_dense)
#define hc_solver_inside HC_NAME(hc_solver_inside)

/* hc_solver_state.c */
#define hc_solver_load HC_NAME(hc_solver_load)
#define hc_solver_save HC_NAME(hc_solver_save)
#define hc_solver_size HC_NAME(hc_solver_size)

/* hc_events.c */
#define hc_look_for_events HC_NAME(hc_look_for_events)
#define hc_pass_events HC_NAME(hc_pass_events)

/* hc_friction.c */
#define hc_friction_excess HC_NAME(hc_friction_excess)
#define hc_friction_modes HC_NAME(hc_friction_modes)

/* hc_ticks.c */
#define hc_ticks_again HC_NAME(hc_ticks_again)
#define hc_ticks_before HC_NAME(hc_ticks_before)
#define hc_ticks_due HC_NAME(hc_ticks_due)
#define hc_ticks_hold HC_NAME(hc_ticks_hold)
#define hc_ticks_place HC_NAME(hc_ticks_place)
#define hc_ticks_size HC_NAME(hc_ticks_size)
#define hc_ticks_start HC_NAME(hc_ticks_start)
#define hc_ticks_take HC_NAME(hc_ticks_take)

/* hc_delays.c */
#define hc_delays_arrive HC_NAME(hc_delays_arrive)
#define hc_delays_count HC_NAME(hc_delays_count)
#define hc_delays_fit HC_NAME(hc_delays_fit)
#define hc_delays_fixed HC_NAME(hc_delays_fixed)
#define hc_delays_free HC_NAME(hc_delays_free)
#define hc_delays_inputs HC_NAME(hc_delays_inputs)
#define hc_delays_load HC_NAME(hc_delays_load)
#define hc_delays_mask HC_NAME(hc_delays_mask)
#define hc_delays_new HC_NAME(hc_delays_new)
#define hc_delays_next HC_NAME(hc_delays_next)
#define hc_delays_rest HC_NAME(hc_delays_rest)
#define hc_delays_save HC_NAME(hc_delays_save)
#define hc_delays_send HC_NAME(hc_delays_send)
#define hc_delays_send_prompt HC_NAME(hc_delays_send_prompt)

/* hc_history.c */
#define hc_history_clear HC_NAME(hc_history_clear)
#define hc_history_count HC_NAME(hc_history_count)
#define hc_history_free HC_NAME(hc_history_free)
#define hc_history_keep HC_NAME(hc_history_keep)
#define hc_history_late HC_NAME(hc_history_late)
#define hc_history_load HC_NAME(hc_history_load)
#define hc_history_new HC_NAME(hc_history_new)
#define hc_history_save HC_NAME(hc_history_save)

/* hc_inner_library.c */
#define hc_library_close HC_NAME(hc_library_close)
#define hc_library_find HC_NAME(hc_library_find)
#define hc_library_open HC_NAME(hc_library_open)
#define hc_library_path HC_NAME(hc_library_path)
#define hc_library_place HC_NAME(hc_library_place)

/* hc_inner_fmi2.c, hc_inner_fmi3.c */
#define hc_inner_bytes HC_NAME(hc_inner_bytes)
#define hc_inner_completed_step HC_NAME(hc_inner_completed_step)
#define hc_inner_enter_continuous HC_NAME(hc_inner_enter_continuous)
#define hc_inner_enter_event HC_NAME(hc_inner_enter_event)
#define hc_inner_forget HC_NAME(hc_inner_forget)
#define hc_inner_get HC_NAME(hc_inner_get)
#define hc_inner_get_derivatives HC_NAME(hc_inner_get_derivatives)
#define hc_inner_get_indicators HC_NAME(hc_inner_get_indicators)
#define hc_inner_get_nominals HC_NAME(hc_inner_get_nominals)
#define hc_inner_get_states HC_NAME(hc_inner_get_states)
#define hc_inner_get_values HC_NAME(hc_inner_get_values)
#define hc_inner_load HC_NAME(hc_inner_load)
#define hc_inner_load_2 HC_NAME(hc_inner_load_2)
#define hc_inner_partials HC_NAME(hc_inner_partials)
#define hc_inner_read HC_NAME(hc_inner_read)
#define hc_inner_reset HC_NAME(hc_inner_reset)
#define hc_inner_save HC_NAME(hc_inner_save)
#define hc_inner_set HC_NAME(hc_inner_set)
#define hc_inner_set_states HC_NAME(hc_inner_set_states)
#define hc_inner_set_time HC_NAME(hc_inner_set_time)
#define hc_inner_set_values HC_NAME(hc_inner_set_values)
#define hc_inner_step HC_NAME(hc_inner_step)
#define hc_inner_update HC_NAME(hc_inner_update)
#define hc_inner_write HC_NAME(hc_inner_write)

/* hc_inner_fmi3.c */
#define hc_inner_load_3 HC_NAME(hc_inner_load_3)

/* hc_around.c */
#define hc_around_after_exit HC_NAME(hc_around_after_exit)
#define hc_around_before_exit HC_NAME(hc_around_before_exit)
#define hc_around_enter HC_NAME(hc_around_enter)
#define hc_around_evaluate HC_NAME(hc_around_evaluate)
#define hc_around_experiment HC_NAME(hc_around_experiment)
#define hc_around_fail HC_NAME(hc_around_fail)
#define hc_around_free HC_NAME(hc_around_free)
#define hc_around_new HC_NAME(hc_around_new)
#define hc_around_passed HC_NAME(hc_around_passed)
#define hc_around_start HC_NAME(hc_around_start)

/* hc_around_values.c */
#define hc_around_before_set HC_NAME(hc_around_before_set)
#define hc_around_find HC_NAME(hc_around_find)
#define hc_around_get HC_NAME(hc_around_get)
#define hc_around_kind HC_NAME(hc_around_kind)
#define hc_around_set HC_NAME(hc_around_set)
#define hc_around_width HC_NAME(hc_around_width)

/* hc_around_partials.c */
#define hc_around_partials HC_NAME(hc_around_partials)

/* hc_around_exchange.c */
#define hc_around_completed_step HC_NAME(hc_around_completed_step)
#define hc_around_enter_continuous HC_NAME(hc_around_enter_continuous)
#define hc_around_enter_event HC_NAME(hc_around_enter_event)
#define hc_around_next HC_NAME(hc_around_next)
#define hc_around_get_part HC_NAME(hc_around_get_part)
#define hc_around_get_nominals HC_NAME(hc_around_get_nominals)
#define hc_around_set_states HC_NAME(hc_around_set_states)
#define hc_around_set_time HC_NAME(hc_around_set_time)
#define hc_around_tick HC_NAME(hc_around_tick)
#define hc_around_update HC_NAME(hc_around_update)

/* hc_around_steps.c */
#define hc_around_begin HC_NAME(hc_around_begin)
#define hc_around_solver HC_NAME(hc_around_solver)
#define hc_around_step HC_NAME(hc_around_step)

/* hc_around_state.c */
#define hc_around_state_size HC_NAME(hc_around_state_size)
#define hc_around_state_free HC_NAME(hc_around_state_free)
#define hc_around_state_set HC_NAME(hc_around_state_set)
#define hc_around_state_read HC_NAME(hc_around_state_read)
#define hc_around_state_get HC_NAME(hc_around_state_get)
#define hc_around_state_write HC_NAME(hc_around_state_write)
#endif

#endif
