"""Training, evaluation and baselines for the Steelyard environments.

Importing this package is light; torch and stable-baselines3 load with the module that needs them:
`steelyard_agents.sb3_vec_env.SB3VecEnv`, `steelyard_agents.make.make_vec_env`,
`steelyard_agents.evaluate.evaluate`, `steelyard_agents.train.train`.
"""
