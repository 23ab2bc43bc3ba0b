"""Free motion of many windows at once, with its exact dependence on initial states, body and effect parameters.

    trajectories   poses, twists, accelerations, tensions of W windows on one time grid (`integrate`)
    sensitivities  their derivatives by every initial state and every shared parameter (`variation`)
    markers        where markers are at any times, with derivatives (`markers`)
    sampled        a trajectory at other times (`sampling`)
    starts         initial twists and lengths with derivatives (`starts`)

For one motion without derivatives `model.motion.simulate_free_motion` is simpler. The *shared* parameters are the
nine of the body (PARAMETER_NAMES) followed by θ of the mechanism's effects. A state is perturbed by
[δp; δφ; δv; δω], the rotation by R → R exp([δφ]×): no chart of the rotation, so nothing ends at half a turn, and
δφ̇ = Rᵀ δω exactly.
"""
