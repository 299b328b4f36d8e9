"""one.py GROUND COND SEED [K=V ...] : prints a line"""
import sys,os,time
try: exec(open("trial/var.py").read())
except Exception: pass
try:
    import agent.policies.stochastic as S
    import agent.policies.living as L
    for k,v in os.environ.items():
        if k.startswith("S_"): setattr(S,k[2:],type(getattr(S,k[2:]))(float(v)))
        if k.startswith("L_"): setattr(L,k[2:],type(getattr(L,k[2:]))(float(v)))
except Exception: pass
from fogwatch.inprocess import run_in_process
from patrol.scenario import load_scenario
ground,cond,seed=sys.argv[1],sys.argv[2],int(sys.argv[3])
sh="maps/"
H={"model":"holonomic"}
G={
"yards":({"builtin":"yards"},1.0,{"count":4,**H}),
"yardsf":({"builtin":"yards"},0.5,{"count":4,**H}),
"yardsc":({"builtin":"yards"},1.0,{"count":4,"model":"car"}),
"yards20":({"builtin":"yards"},1.0,{"count":20,**H}),
"example8":({"map":sh+"example.yaml"},0.2,{"count":8,**H,"radius":0.3,"speed":1.0}),
"office7":({"map":"examples/maps/office.yaml"},0.2,{"count":7,"model":"differential","radius":0.3,"speed":1.0}),
"cumberland12":({"map":sh+"cumberland.yaml"},0.2,{"count":12,**H,"radius":0.3,"speed":1.0}),
"yards12":({"builtin":"yards"},1.0,{"count":12,**H}),
"yards16":({"builtin":"yards"},1.0,{"count":16,**H}),
"cumberland7":({"map":sh+"cumberland.yaml"},0.2,{"count":7,**H,"radius":0.3,"speed":1.0}),
"cumberland9":({"map":sh+"cumberland.yaml"},0.2,{"count":9,**H,"radius":0.3,"speed":1.0}),
"example5":({"map":sh+"example.yaml"},0.2,{"count":5,**H,"radius":0.3,"speed":1.0}),
"example6":({"map":sh+"example.yaml"},0.2,{"count":6,**H,"radius":0.3,"speed":1.0}),
"office5":({"map":"examples/maps/office.yaml"},0.2,{"count":5,"model":"differential","radius":0.3,"speed":1.0}),
"yards8":({"builtin":"yards"},1.0,{"count":8,**H}),
"clutter":({"builtin":"clutter"},1.0,{"count":5,**H}),
"site":({"builtin":"site"},1.0,{"count":5,"model":"car"}),
"siteh":({"builtin":"site"},1.0,{"count":4,**H}),
"site13":({"builtin":"site"},1.0,{"count":13,**H}),
"site26":({"builtin":"site"},1.0,{"count":26,**H}),
"office":({"map":"examples/maps/office.yaml"},0.2,{"count":4,"model":"differential","radius":0.3,"speed":1.0}),
"office3":({"map":"examples/maps/office.yaml"},0.2,{"count":3,"model":"differential","radius":0.3,"speed":1.0}),
"example":({"map":sh+"example.yaml"},0.2,{"count":4,**H,"radius":0.3,"speed":1.0}),
"cumberland":({"map":sh+"cumberland.yaml"},0.2,{"count":4,**H,"radius":0.3,"speed":1.0}),
}
terrain,point,robots=G[ground]
dur={"office":1500,"office3":1500}.get(ground,1200)
m={"terrain":terrain,"point":point,"duration":dur,"seed":seed,"robots":robots,"patrol":{"policy":os.environ.get("POLICY","stochastic"),"options":{"unpredictability":float(os.environ["UNP"])} if "UNP" in os.environ else {}}}
f=[]
for c in cond.split("+"):
    if c[0]=="l" and c[1:].isdigit(): f.append({"kind":"loss","rate":int(c[1:])/100})
    elif c=="kill": f.append({"kind":"kill","who":"r2","at":dur/3,"wreck":"removed"})
    elif c=="killw": f.append({"kind":"kill","who":"r2","at":dur/3})
    elif c=="d1": f.append({"kind":"delay","delay":{"constant":1.0}})
    elif c=="d3": f.append({"kind":"delay","delay":{"constant":3.0}})
    elif c=="r30": f.append({"kind":"range","reach":30})
    elif c=="slow": m["robots"]=[{**{k:v for k,v in robots.items() if k!="count"},"speed":(robots.get("speed",4.4))*(.95 if i==0 else 1)} for i in range(robots["count"])]
    elif c=="speeds": m["robots"]=[{**{k:v for k,v in robots.items() if k!="count"},"speed":(robots.get("speed",4.4))*(.5,.75,1,1.25)[i%4]} for i in range(robots["count"])]
    elif c=="bodies": m["robots"]=[{**{k:v for k,v in robots.items() if k not in("count","model")},"model":("holonomic","differential","car")[i%3]} for i in range(robots["count"])]
m["faults"]=f
t=time.time()
o=run_in_process(load_scenario(m),keep=False,verify_fog=False)
s=o.summary
d=s if isinstance(s,dict) else s.model_dump()
mf="mean %.1f late %.1f max %.0f"%(d["mfow_mean_s"],d["mfow_late_mean_s"],d["mfow_max_s"])
env=" ".join(f"{k}={v}" for k,v in sorted(os.environ.items()) if k[:2] in("P_","S_","L_","R_") or k in ("POLICY","UNP"))
bt=d.get("best_tour_s") or (d.get("bounds") or {})
pl=[r.get("planned_share") for r in d["robots"].values()] if isinstance(d.get("robots"),dict) else ""
bumps=sum(r.get("collisions",0) for r in d["robots"].values())

print(ground,cond,seed,env,"|",mf,"bumps",bumps,"|",f"{time.time()-t:.0f}s",flush=True)
