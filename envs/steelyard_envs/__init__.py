"""Gymnasium environments on the Steelyard engine; importing this registers them and nothing more."""

from steelyard_envs.registration import register_all

register_all()
