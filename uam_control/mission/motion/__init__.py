"""Motions along time: septic and quintic moves, polynomials, braking, flatness of the base."""
