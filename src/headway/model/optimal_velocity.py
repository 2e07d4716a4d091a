from headway.models.optimal_velocity import *  # temporary
