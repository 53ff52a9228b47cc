"""How large numerical errors are: known answers, time steps, other engines, extreme cases."""
