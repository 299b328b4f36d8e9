import os
import agent.policies.common_plan.plan as P
for k,v in os.environ.items():
    if k.startswith("P_"): setattr(P,k[2:],type(getattr(P,k[2:]))(float(v)))
