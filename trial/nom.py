exec(open("trial/var.py").read())
import sys,time,numpy as np
from patrol.scenario import load_scenario
from patrol.prepare import prepare
from agent.build import Shared
from agent.ports import *
from agent.policies.common_plan.plan import *
from agent.policies.common_plan.stations import *
from patrol.prepare import prepare
n=int(sys.argv[1]); terrain=eval(sys.argv[2]); point=float(sys.argv[3]); ticks=int(sys.argv[4]) if len(sys.argv)>4 else 2400
sc=load_scenario({"terrain":terrain,"point":point,"robots":{"count":n,**eval(__import__("os").environ.get("ROB","{}")),"model":__import__("os").environ.get("MODEL","holonomic")},"patrol":{"policy":"stochastic"},"seed":3003})
p=prepare(sc); sh=Shared(p)
spec=sc.roster[0]; f=p.fields[1]
setup=PolicySetup(RobotSetup(spec,sc.lengths[1]),GroundSetup(p.terrain,f,sh.posts_of(f),sh.footprint,sh.known,{}),sh.fleet,sh.kind.options)
r=sh.known.rounds[1]
known=KnownStations(r)
t=time.time(); plan=CommonPlan(setup,known,sc.roster,0); print("init",time.time()-t,"stations",len(known),"L",r.length_m,"T",plan.interval_s,"stride",spec.speed*sc.step,"range",sh.footprint.range_m,"step",sc.step)
m=[];t=time.time();nv=0
for k in range(ticks):
    plan.advance_to(plan.tick+1)
    seen=plan._ground.last_seen.flat[known.points]; m.append((plan.tick-seen.min())*sc.step)
dt=time.time()-t
m=np.array(m)
print("mean mfow",m.mean(),"2nd half",m[len(m)//2:].mean(),"max",m.max(),"ms/tick",1000*dt/ticks,"draws",plan._draws, "per robot s per draw",ticks*sc.step*n/plan._draws)
