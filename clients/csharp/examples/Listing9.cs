using Nep;

// The program of the paper's listing 9: publish one message and end.
namespace Example
{
    class Program
    {
        class Msg
        {
            public string message { get; set; }
        }

        static void Main(string[] args)
        {
            Nep.Node node = new Nep.Node("csharp_sender");
            Nep.Publisher pub = node.new_pub("test", "json");
            Msg msg = new Msg();
            msg.message = "hello";
            pub.publish(msg);
        }
    }
}
